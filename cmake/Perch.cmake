# What builds everything: perch_add_room, perch_add_program and perch_add_test.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Release, Debug, RelWithDebInfo" FORCE)
endif()
# Some libraries ask for it, and a precompiled header is used only where all is compiled alike.
add_compile_options(-pthread)
# Where it is installed. A first build is slower by it: it reads the precompiled headers for each file.
find_program(PERCH_CCACHE ccache)
if(PERCH_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${PERCH_CCACHE})
  add_compile_options(-fpch-preprocess)  # which ccache asks for
endif()

option(PERCH_SANITIZE "Address and undefined-behaviour sanitizers" OFF)

# What every target of ours is compiled with. No contraction of a*b+c: x86 and ARM then round alike,
# which bit-exact replay needs. -Wrestrict is wrong on "text" + std::string(...) in g++ 12 (GCC bug 105651), and
# so are -Wstringop-overflow, -Wstringop-overread and -Warray-bounds, which with precompiled headers are said of the
# standard library's own lines.
function(perch_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Werror -Wno-restrict
                                           -Wno-stringop-overflow -Wno-stringop-overread -Wno-array-bounds -ffp-contract=off)
  if(PERCH_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=address,undefined -fno-sanitize-recover=undefined
                                             -fno-omit-frame-pointer)
    target_link_options(${target} PRIVATE -fsanitize=address,undefined)
  endif()
  # Reading an uninitialised matrix then gives NaN, which the tests see.
  target_compile_definitions(${target} PRIVATE $<$<CONFIG:Debug>:EIGEN_INITIALIZE_MATRICES_BY_NAN>)
endfunction()

# Headers that most files include, read once instead of once a file: a third of a cold build. A file includes what
# it uses all the same.
function(perch_add_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LINK" ${ARGN})
  add_library(${name} OBJECT ${PROJECT_SOURCE_DIR}/cmake/precompiled.cc)
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS} <algorithm> <array> <cmath> <cstdint> <filesystem> <fstream>
                            <functional> <map> <memory> <optional> <span> <sstream> <string> <vector>)
  perch_compile_options(${name})
endfunction()

# perch_add_room(pose SOURCES a.cc b.cc LINK perch_geometry perch_camera Ceres::ceres)
# A library of src/perch/ROOM. Its headers are seen only by those that link it, so that a room which
# includes one it does not link does not compile; and a room below this one is no target yet.
function(perch_add_room room)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  foreach(library ${ARG_LINK})
    if(library MATCHES "^perch_" AND NOT TARGET ${library})
      message(FATAL_ERROR "perch_${room} links ${library}, which is no room above it")
    endif()
  endforeach()
  set(view ${PROJECT_BINARY_DIR}/rooms/${room}/perch)
  file(MAKE_DIRECTORY ${view})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/src/perch/${room} ${view}/${room} SYMBOLIC)
  if(ARG_SOURCES)
    add_library(perch_${room} STATIC ${ARG_SOURCES})
    target_include_directories(perch_${room} PUBLIC ${PROJECT_BINARY_DIR}/rooms/${room})
    target_link_libraries(perch_${room} PUBLIC ${ARG_LINK})
    perch_compile_options(perch_${room})
    target_precompile_headers(perch_${room} REUSE_FROM perch_precompiled)
  else()
    add_library(perch_${room} INTERFACE)
    target_include_directories(perch_${room} INTERFACE ${PROJECT_BINARY_DIR}/rooms/${room})
    target_link_libraries(perch_${room} INTERFACE ${ARG_LINK})
  endif()
endfunction()

# perch_add_test(pose/refine LINK perch_simulation): tests/pose/refine_test.cc, named pose/refine in ctest.
# It links its own room and what LINK adds.
function(perch_add_test name)
  cmake_parse_arguments(ARG "" "" "LINK" ${ARGN})
  string(REPLACE "/" "_" target ${name}_test)
  cmake_path(GET name PARENT_PATH room)
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/${name}_test.cc)
  if(TARGET perch_${room})
    target_link_libraries(${target} PRIVATE perch_${room})
  endif()
  target_link_libraries(${target} PRIVATE perch_testing ${ARG_LINK})
  perch_compile_options(${target})
  # What a test itself does is little: the rooms do the work. Compiling it is most of a build.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  target_precompile_headers(${target} REUSE_FROM perch_precompiled_for_tests)
  add_test(NAME ${name} COMMAND ${target})
  # Exit code 77 would be a whole test skipped; single skips are GTEST_SKIP lines.
  set_tests_properties(${name} PROPERTIES TIMEOUT 300)
endfunction()

# perch_add_program(perch-batch SOURCES perch_batch.cc LINK perch_analysis)
function(perch_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} gflags glog::glog)
  target_compile_definitions(${name} PRIVATE PERCH_VERSION="${PROJECT_VERSION}")
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  perch_compile_options(${name})
  target_precompile_headers(${name} REUSE_FROM perch_precompiled)
endfunction()

# Checks the order of the rooms without building: cmake -DSOURCE=… -P RoomOrder.cmake
#   1. each perch_add_room links only rooms that CMakeLists.txt lists above it;
#   2. each #include "perch/ROOM/…" in a room names that room or one in the closure of its links.
# The build enforces the same, but its complaint is a missing header: this one names the file, line and room.
cmake_minimum_required(VERSION 3.25)
set(complaints "")

# The rooms in their order, from the foreach that adds them.
file(READ ${SOURCE}/CMakeLists.txt text)
if(NOT text MATCHES "foreach\\(room ([^)]*)\\)")
  message(FATAL_ERROR "${SOURCE}/CMakeLists.txt: expected foreach(room …), found none")
endif()
string(REGEX MATCHALL "[^ \n]+" rooms "${CMAKE_MATCH_1}")

# What each room may include: itself and, as those above are known by now, all that its links may.
set(above "")
foreach(room ${rooms})
  set(list src/perch/${room}/CMakeLists.txt)
  file(READ ${SOURCE}/${list} text)
  set(may_${room} ${room})
  string(REGEX MATCHALL "perch_[a-z]+" links "${text}")
  list(REMOVE_ITEM links perch_add perch_${room})  # perch_add_room itself, and a target's own name
  foreach(link ${links})
    string(REPLACE "perch_" "" link ${link})
    if(link IN_LIST above)
      list(APPEND may_${room} ${may_${link}})
    elseif(link IN_LIST rooms)
      list(APPEND complaints "${list}: ${room} links ${link}, which is not above it")
    endif()
  endforeach()
  list(APPEND above ${room})
endforeach()

foreach(room ${rooms})
  file(GLOB_RECURSE files RELATIVE ${SOURCE} ${SOURCE}/src/perch/${room}/*.h ${SOURCE}/src/perch/${room}/*.cc)
  foreach(file ${files})
    file(READ ${SOURCE}/${file} text)
    if(NOT text MATCHES "#include \"perch/")
      continue()
    endif()
    # One list item a line: what a list would take for its own goes, and an empty line keeps its place.
    string(REGEX REPLACE "[][;\\\\]" " " text "${text}")
    string(REPLACE "\n" " ;" lines "${text}")
    set(number 0)
    foreach(line IN LISTS lines)
      math(EXPR number "${number} + 1")
      if(line MATCHES "^#include \"perch/([a-z]+)/" AND NOT CMAKE_MATCH_1 IN_LIST may_${room})
        list(APPEND complaints "${file}:${number}: ${room} includes ${CMAKE_MATCH_1}, which it does not link")
      endif()
    endforeach()
  endforeach()
endforeach()

foreach(complaint ${complaints})
  message(NOTICE "${complaint}")
endforeach()
if(complaints)
  message(FATAL_ERROR "The rooms are out of order.")
endif()
list(LENGTH rooms count)
message(STATUS "${count} rooms in order")

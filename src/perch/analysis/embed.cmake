# Writes page_assets.cc: files as C++ strings.
#   cmake -D OUTPUT=page_assets.cc -D "ASSETS=kReportJs=path/report.js;..." -P embed.cmake
set(text "// Made by embed.cmake.\n#include \"perch/analysis/page_assets.h\"\n\nnamespace perch {\n\n")
foreach(asset ${ASSETS})
  string(REGEX MATCH "^([^=]+)=(.+)$" _ "${asset}")
  set(name ${CMAKE_MATCH_1})
  set(file ${CMAKE_MATCH_2})
  file(READ "${file}" content)
  # Inlined in a page, the first would end its <script> or <style>; the second the C++ literal.
  string(REGEX MATCH "</[sS][cC][rR][iI][pP][tT]|</[sS][tT][yY][lL][eE]|\\)perch_asset\"" trap "${content}")
  if(trap)
    message(FATAL_ERROR "${file} holds ${trap} and cannot be inlined")
  endif()
  string(APPEND text "const std::string_view ${name} = R\"perch_asset(${content})perch_asset\";\n")
endforeach()
string(APPEND text "\n}  // namespace perch\n")
file(WRITE "${OUTPUT}" "${text}")

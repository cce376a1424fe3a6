# cmake -DHEADERS=FOLDER -P guard_strings.cmake
# lcm-gen 1.3.1 checks that a string's length is not too large, but not that it is not negative: -2^31 - 1 overflows into a copy of
# 2 GB, and one message on the bus ends any process that reads it. Lengths below 1 (the closing zero counts) are refused here.
file(GLOB headers ${HEADERS}/*.hpp)
foreach(header ${headers})
  file(READ ${header} text)
  string(REGEX REPLACE "if\\((__[A-Za-z0-9_]+_len__) > maxlen - pos\\)" "if(\\1 < 1 || \\1 > maxlen - pos)" guarded "${text}")
  if(NOT guarded STREQUAL text)
    file(WRITE ${header} "${guarded}")
  endif()
endforeach()

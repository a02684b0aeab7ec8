# A toolchain file for CMake: Windows programs by the g++ of MinGW-w64 (Debian and Ubuntu:
# g++-mingw-w64-x86-64-posix), which run under Wine (wine64) where it is installed.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
# With <thread>: its other variant, -win32, has none before version 13.
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix)
set(CMAKE_FIND_ROOT_PATH /usr/x86_64-w64-mingw32)
foreach(what LIBRARY INCLUDE PACKAGE)  # nothing of the system that compiles
  set(CMAKE_FIND_ROOT_PATH_MODE_${what} ONLY)
endforeach()
set(CMAKE_EXE_LINKER_FLAGS_INIT -static)  # no DLL of the compiler's has to be found
find_program(ISM_WINE NAMES wine64 wine PATHS /usr/lib/wine NO_CMAKE_FIND_ROOT_PATH)
mark_as_advanced(ISM_WINE)
if(ISM_WINE)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${ISM_WINE}")
endif()

# Stands for vcpkg: defines what the port calls, as far as it matters to the port, and runs it.
#   cmake -DPORT_DIR=dir -DWORK=dir -DARGUMENTS=list -P vcpkg.cmake
# WORK/packages is then what vcpkg would install; ARGUMENTS are those of its toolchain.

set(PORT ism-hpp)
set(CURRENT_PACKAGES_DIR "${WORK}/packages")

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGN}")
  endif()
endfunction()

function(vcpkg_cmake_configure)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" SOURCE_PATH OPTIONS)
  run("${CMAKE_COMMAND}" -S "${arg_SOURCE_PATH}" -B "${WORK}/build" -DCMAKE_BUILD_TYPE=Release
      "-DCMAKE_INSTALL_PREFIX=${CURRENT_PACKAGES_DIR}" ${ARGUMENTS} ${arg_OPTIONS})
endfunction()

function(vcpkg_cmake_install)
  run("${CMAKE_COMMAND}" --build "${WORK}/build" --target install)
endfunction()

# Moves the files, and says in them how far the prefix is now.
function(vcpkg_cmake_config_fixup)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "PACKAGE_NAME;CONFIG_PATH" "")
  set(folder "${CURRENT_PACKAGES_DIR}/share/${arg_PACKAGE_NAME}")
  file(GLOB files "${CURRENT_PACKAGES_DIR}/${arg_CONFIG_PATH}/*")
  file(COPY ${files} DESTINATION "${folder}")
  file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/share/cmake")
  set(config "${folder}/${arg_PACKAGE_NAME}Config.cmake")
  file(READ "${config}" text)
  string(REPLACE "\"\${CMAKE_CURRENT_LIST_DIR}/../../../\"" "\"\${CMAKE_CURRENT_LIST_DIR}/../../\""
         text "${text}")
  file(WRITE "${config}" "${text}")
endfunction()

# That of vcpkg changes what is absolute in these files; there is nothing.
function(vcpkg_fixup_pkgconfig)
  file(GLOB files "${CURRENT_PACKAGES_DIR}/share/pkgconfig/*.pc")
  file(STRINGS "${files}" lines REGEX "^prefix=")
  if(NOT lines MATCHES "^prefix=\\$.pcfiledir.")
    message(FATAL_ERROR "pkg-config's file is not relative: ${lines}")
  endif()
endfunction()

function(vcpkg_install_copyright)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "" FILE_LIST)
  configure_file("${arg_FILE_LIST}" "${CURRENT_PACKAGES_DIR}/share/${PORT}/copyright" COPYONLY)
endfunction()

include("${PORT_DIR}/portfile.cmake")

# A port of the folder that it lies in, see ../../README.md. The package is the header and what CMake
# needs: the implementation is compiled in the build of whoever uses it, so there is nothing to build
# here, and nothing that depends on the type of build.
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../../.." ABSOLUTE)
set(VCPKG_BUILD_TYPE release)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    -DISM_BUILD_EXAMPLES=OFF
    -DISM_BUILD_TESTS=OFF
    -DISM_BUILD_C=OFF
    -DISM_INSTALL=ON
    -DCMAKE_SKIP_INSTALL_ALL_DEPENDENCY=ON
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(PACKAGE_NAME ism CONFIG_PATH share/cmake/ism)
vcpkg_fixup_pkgconfig()
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")

"""ism.hpp of the folder that this recipe lies in, see ../README.md, for Conan 2."""

import os
import re

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load


class Ism(ConanFile):
    name = "ism-hpp"
    description = "Distortion-minimizing injective maps between surfaces"
    license = "MIT"
    topics = ("geometry", "meshes", "surface-maps", "correspondence")
    package_type = "static-library"
    settings = "os", "compiler", "build_type", "arch"

    def _project(self):
        return os.path.join(self.recipe_folder, "..", "..", "..")

    def set_version(self):
        # The version stands in the header only.
        header = load(self, os.path.join(self._project(), "ism.hpp"))
        parts = re.findall(r"^#define ISM_VERSION_(?:MAJOR|MINOR|PATCH) +(\d+)", header, re.M)
        self.version = ".".join(parts)

    def export_sources(self):
        for name in ("ism.hpp", "examples/ism_verify.hpp", "CMakeLists.txt", "LICENSE"):
            copy(self, name, self._project(), self.export_sources_folder)

    def requirements(self):
        self.requires("eigen/[>=3.3 <4]", transitive_headers=True)

    def validate(self):
        check_min_cppstd(self, 17)

    def layout(self):
        cmake_layout(self)

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        for name in ("EXAMPLES", "TESTS", "C"):
            toolchain.cache_variables["ISM_BUILD_" + name] = False
        toolchain.cache_variables["ISM_INSTALL"] = False
        toolchain.cache_variables["ISM_NATIVE"] = False  # the package is for other computers, too
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build(target="ism")

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        include = os.path.join(self.package_folder, "include")
        copy(self, "ism.hpp", self.source_folder, include)
        copy(self, "ism_verify.hpp", os.path.join(self.source_folder, "examples"), include)
        for pattern in ("*.a", "*.lib"):
            library = os.path.join(self.package_folder, "lib")
            copy(self, pattern, self.build_folder, library, keep_path=False)

    def package_info(self):
        # find_package(ism) and the targets of the project's own package.
        self.cpp_info.set_property("cmake_file_name", "ism")
        header = self.cpp_info.components["header"]
        header.set_property("cmake_target_name", "ism::header")
        header.requires = ["eigen::eigen"]
        header.libdirs = []
        if self.settings.os in ("Linux", "FreeBSD"):
            header.system_libs = ["pthread"]
        library = self.cpp_info.components["ism"]
        library.set_property("cmake_target_name", "ism::ism")
        library.libs = ["ism"]
        library.requires = ["header"]

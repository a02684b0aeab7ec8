"""Stands for Conan 2: defines what the recipe uses, as far as it matters to it, and runs it.

    python3 conan.py RECIPE WORK CMAKE [ARGUMENT...]

WORK/package is then the package, and WORK/deps the CMake files that Conan would write for those
who use it. The arguments are those of Conan's toolchain.
"""

import collections
import fnmatch
import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys
import types

RECIPE, WORK, CMAKE, *ARGUMENTS = sys.argv[1:]


class Info:
    """What a package, or a component of it, tells."""

    def __init__(self):
        self.properties = {}
        self.includedirs, self.libdirs = ["include"], ["lib"]
        self.libs, self.system_libs, self.requires = [], [], []
        self.components = collections.defaultdict(Info)

    def set_property(self, name, value):
        self.properties[name] = value


class ConanFile:
    settings = ()

    def __init__(self):
        system = {"linux": "Linux", "darwin": "Macos", "win32": "Windows"}[sys.platform]
        self.settings = types.SimpleNamespace(os=system)
        self.recipe_folder = os.path.dirname(RECIPE)
        self.export_sources_folder = self.source_folder = os.path.join(WORK, "source")
        self.build_folder = os.path.join(WORK, "build")
        self.package_folder = os.path.join(WORK, "package")
        self.cpp_info = Info()
        self.required = []

    def requires(self, reference, **_traits):
        self.required.append(reference)


class CMakeToolchain:
    def __init__(self, recipe):
        self.recipe, self.cache_variables = recipe, {}

    def generate(self):
        self.recipe.cache_variables = self.cache_variables


class CMakeDeps:
    def __init__(self, _recipe):
        pass

    def generate(self):
        """Eigen is where the arguments say."""


class CMake:
    def __init__(self, recipe):
        self.recipe = recipe

    def configure(self):
        recipe = self.recipe
        switches = [f"-D{k}={'ON' if v else 'OFF'}" for k, v in recipe.cache_variables.items()]
        folders = ["-S", recipe.source_folder, "-B", recipe.build_folder]
        subprocess.check_call([CMAKE, *folders, *ARGUMENTS, *switches])

    def build(self, target):
        subprocess.check_call([CMAKE, "--build", self.recipe.build_folder, "--target", target])


def copy(_recipe, pattern, src, dst, keep_path=True):
    for path in sorted(pathlib.Path(src).rglob(pattern)):
        relative = path.relative_to(src)
        if path.is_file() and fnmatch.fnmatch(str(relative), pattern):
            to = pathlib.Path(dst) / (relative if keep_path else path.name)
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, to)


def module(name, **contents):
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(contents)


module("conan", ConanFile=ConanFile)
module("conan.tools")
module("conan.tools.build", check_min_cppstd=lambda _recipe, _standard: None)
module("conan.tools.cmake", CMake=CMake, CMakeDeps=CMakeDeps, CMakeToolchain=CMakeToolchain,
       cmake_layout=lambda _recipe: None)
module("conan.tools.files", copy=copy, load=lambda _recipe, path: pathlib.Path(path).read_text())


def write_deps(recipe):
    """Imported targets of the components, as CMakeDeps makes them."""
    info, folder = recipe.cpp_info, recipe.package_folder
    target = {name: c.properties["cmake_target_name"] for name, c in info.components.items()}
    target["eigen::eigen"] = "Eigen3::Eigen"
    lines = ["find_package(Eigen3 REQUIRED CONFIG)", "find_package(Threads REQUIRED)"]
    for name, c in info.components.items():
        places = {d: [os.path.join(folder, x) for x in getattr(c, d)]
                  for d in ("includedirs", "libdirs")}
        files = [str(next(pathlib.Path(d).glob(f"*{x}.*"))) for x in c.libs
                 for d in places["libdirs"]]
        links = files + [target[x] for x in c.requires] + c.system_libs
        lines += [f"add_library({target[name]} INTERFACE IMPORTED)",
                  f"target_link_libraries({target[name]} INTERFACE {' '.join(links)})",
                  f"target_include_directories({target[name]} INTERFACE "
                  f"{' '.join(places['includedirs'])})"]
    deps = pathlib.Path(WORK) / "deps"
    deps.mkdir()
    file_name = info.properties["cmake_file_name"]
    (deps / f"{file_name}Config.cmake").write_text("\n".join(lines) + "\n")
    (deps / f"{file_name}ConfigVersion.cmake").write_text(
        f'set(PACKAGE_VERSION "{recipe.version}")\n'
        "if(NOT PACKAGE_FIND_VERSION VERSION_GREATER PACKAGE_VERSION)\n"
        "  set(PACKAGE_VERSION_COMPATIBLE TRUE)\nendif()\n")


def main():
    spec = importlib.util.spec_from_file_location("conanfile", RECIPE)
    conanfile = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(conanfile)
    recipe = conanfile.Ism()
    for step in ("set_version", "export_sources"):
        getattr(recipe, step)()
    recipe.recipe_folder = None  # Conan builds from the copy
    for step in ("requirements", "validate", "layout", "generate", "build", "package",
                 "package_info"):
        getattr(recipe, step)()
    write_deps(recipe)
    print(f"{recipe.name}/{recipe.version}, which requires {', '.join(recipe.required)}")


main()

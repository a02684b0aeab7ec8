"""Builds the shared library by CMake and puts it beside the package; the rest is in pyproject.toml.

CMAKE_ARGS in the environment is passed to CMake, e.g. -DISM_NATIVE=ON for this processor alone.
"""

import os
import pathlib
import re
import shlex
import shutil
import subprocess

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # setuptools before 70
    from wheel.bdist_wheel import bdist_wheel

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
NAMES = ("libism_c.so", "libism_c.dylib", "ism_c.dll")


def version():
    """The version of ism.hpp."""
    text = (PROJECT / "ism.hpp").read_text(encoding="utf-8")
    return ".".join(re.findall(r"^#define ISM_VERSION_(?:MAJOR|MINOR|PATCH) +(\d+)", text, re.M))


def build_library(folder):
    """Returns the path of the library, built in the folder."""
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DISM_BUILD_C=ON", "-DISM_NATIVE=OFF"]
    options += ["-DISM_%s=OFF" % part for part in ("BUILD_EXAMPLES", "BUILD_TESTS", "INSTALL")]
    options += shlex.split(os.environ.get("CMAKE_ARGS", ""))
    folder = os.path.abspath(folder)
    subprocess.run(["cmake", "-S", str(PROJECT), "-B", folder] + options, check=True)
    subprocess.run(
        ["cmake", "--build", folder, "--target", "ism_c", "--config", "Release"], check=True
    )
    return next(path for name in NAMES for path in sorted(pathlib.Path(folder).rglob(name)))


class BuildWithLibrary(build_py):
    def run(self):
        super().run()
        library = build_library(self.get_finalized_command("build").build_temp)
        is_in_place = getattr(self, "editable_mode", False)
        package = HERE / "src" / "ism" if is_in_place else pathlib.Path(self.build_lib) / "ism"
        shutil.copy(str(library.resolve()), str(package / library.name))
        shutil.copy(str(PROJECT / "LICENSE"), str(package / "LICENSE"))


class WheelOfLibrary(bdist_wheel):
    """For any Python 3, since ctypes loads the library, but for one platform."""

    def finalize_options(self):
        super().finalize_options()
        self.root_is_pure = False

    def get_tag(self):
        return ("py3", "none", super().get_tag()[2])


class DistributionWithLibrary(Distribution):
    def has_ext_modules(self):
        return True


setup(
    version=version(),
    cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": WheelOfLibrary},
    distclass=DistributionWithLibrary,
)

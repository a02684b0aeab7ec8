#!/usr/bin/env python3
"""Builds the library and packs it with the add-on: one zip, for computers of the same kind.

    make_zip.py [-o FILE.zip] [--library libism_c.so]

CMAKE_ARGS in the environment is passed to CMake.
"""

import argparse
import os
import pathlib
import re
import shlex
import subprocess
import sysconfig
import tempfile
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
NAMES = ("libism_c.so", "libism_c.dylib", "ism_c.dll")


def version() -> str:
    """The version of ism.hpp."""
    text = (PROJECT / "ism.hpp").read_text(encoding="utf-8")
    return ".".join(re.findall(r"^#define ISM_VERSION_(?:MAJOR|MINOR|PATCH) +(\d+)", text, re.M))


def build_library(folder: str) -> pathlib.Path:
    """Returns the path of the library, built in the folder."""
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DISM_BUILD_C=ON", "-DISM_NATIVE=OFF"]
    options += [f"-DISM_{part}=OFF" for part in ("BUILD_EXAMPLES", "BUILD_TESTS", "INSTALL")]
    options += shlex.split(os.environ.get("CMAKE_ARGS", ""))
    subprocess.run(["cmake", "-S", str(PROJECT), "-B", folder, *options], check=True)
    build = ["cmake", "--build", folder, "--target", "ism_c", "--config", "Release"]
    subprocess.run(build, check=True)
    return next(path for name in NAMES for path in sorted(pathlib.Path(folder).rglob(name)))


def pack(library: pathlib.Path, output: pathlib.Path) -> None:
    addon, package = HERE / "map_surface", PROJECT / "examples" / "python" / "src" / "ism"
    files = {f"map_surface/{path.name}": path for path in sorted(addon.glob("*.py"))}
    files.update({f"map_surface/ism/{path.name}": path for path in sorted(package.glob("*.py"))})
    name = next(name for name in NAMES if library.name.startswith(name))  # without a version
    files[f"map_surface/ism/{name}"] = library
    files["map_surface/LICENSE"] = PROJECT / "LICENSE"
    with zipfile.ZipFile(output, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in files.items():
            archive.write(path.resolve(), name)


def main() -> None:
    name = f"map_surface-{version()}-{sysconfig.get_platform()}.zip"
    parser = argparse.ArgumentParser(description="Makes the add-on's zip.")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path(name))
    parser.add_argument("--library", type=pathlib.Path, help="one that exists; it is not built")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        pack(arguments.library or build_library(folder), arguments.output)
    print(f"{arguments.output}: {arguments.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()

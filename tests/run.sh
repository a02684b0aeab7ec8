#!/usr/bin/env bash
# Builds and runs all tests, from any folder. On Debian and Ubuntu it installs what is missing.
#   tests/run.sh [ARGUMENT...]   arguments of CMake's configuration
#   BUILD=dir     the build folder (default: build/ of the project)
#   JOBS=n        compilers and tests at a time (default: one per processor)
#   EXCLUDE=names leaves out tests whose names match this regular expression
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
build="${BUILD:-build}"
jobs="${JOBS:-$(nproc 2>/dev/null || echo 2)}"

source .ci/packages.sh
install doctest-dev has_header doctest/doctest.h
install libboost-dev has_header boost/multiprecision/cpp_int.hpp
install libtinygltf-dev has_header tiny_gltf.h
install libassimp-dev has_header assimp/scene.h
install assimp-utils command -v assimp
install mono-mcs command -v mcs
install mono-runtime command -v mono
for module in numpy pytest pip setuptools wheel scipy matplotlib tqdm; do
  install python3-$module /usr/bin/python3 -c "import $module"
done
install python3-venv /usr/bin/python3 -c "import ensurepip"

cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=Release -DISM_BUILD_EXAMPLES=ON -DISM_BUILD_TESTS=ON \
  -DISM_BUILD_BENCH=ON "$@"
cmake --build "$build" --parallel "$jobs"
cd "$build"
ctest --parallel "$jobs" --output-on-failure --no-tests=error --exclude-regex "${EXCLUDE:-^$}"

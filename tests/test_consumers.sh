#!/usr/bin/env bash
# Builds and runs a program that uses the library in every way the README names: a plain copy of the
# header, add_subdirectory, and find_package after the installed files were moved.
#   test_consumers.sh CMAKE CXX_COMPILER
set -euo pipefail

cmake="$1"
compiler="$2"
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

# What a consumer has: two files that use the API, one of which may hold the implementation.
mkdir "$work/app"
cat > "$work/app/mesh.cpp" <<'CPP'
#include "ism.hpp"

ism::TriangleMesh bent_square(double height) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(5, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, height;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4;
  return mesh;
}
CPP
cat > "$work/app/main.cpp" <<'CPP'
#ifdef HOLDS_IMPLEMENTATION
#define ISM_IMPLEMENTATION
#endif
#include "ism.hpp"

ism::TriangleMesh bent_square(double height);

int main() {
  const ism::TriangleMesh a = bent_square(0), b = bent_square(0.3);
  const ism::Result result = ism::compute_map(a, b, {{0, 0}, {2, 2}});
  if (!ism::is_usable(result.status)) return 1;
  const ism::SurfaceMap map(a, b, result.f, result.g);
  return map.forward_vertex(4).covered ? 0 : 2;
}
CPP

# What find_package and a CMake target bring is read off Eigen's package, for the plain copy too.
cat > "$work/app/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.16)
project(app LANGUAGES CXX)
if(ISM_FOLDER)
  add_subdirectory("${ISM_FOLDER}" ism)
else()
  find_package(ism REQUIRED)
endif()
add_executable(app main.cpp mesh.cpp)
target_link_libraries(app PRIVATE ${ISM_TARGET})
if(ISM_TARGET STREQUAL "ism::header")
  target_compile_definitions(app PRIVATE HOLDS_IMPLEMENTATION)
endif()
CMAKE

# build NAME ARGUMENTS...: configures, builds and runs the program. The configuration has no flags
# of its own: compiling without optimisation is what takes least time.
build() {
  local name="$1"
  shift
  "$cmake" -S "$work/app" -B "$work/$name" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_BUILD_TYPE=Plain "$@" > "$work/log" 2>&1 &&
    "$cmake" --build "$work/$name" >> "$work/log" 2>&1 || {
      cat "$work/log"
      echo "$name: does not build"
      exit 1
    }
  "$work/$name/app" || {
    echo "$name: exit code $?"
    exit 1
  }
  echo "$name: works"
}

# A plain copy beside the sources, without CMake.
cp "$project/ism.hpp" "$work/app"
eigen="$(cd "$work" && "$cmake" --find-package -DNAME=Eigen3 -DCOMPILER_ID=GNU -DLANGUAGE=CXX -DMODE=COMPILE)"
(cd "$work/app" && "$compiler" -std=c++17 $eigen -DHOLDS_IMPLEMENTATION main.cpp mesh.cpp -pthread \
  -o "$work/copy")
"$work/copy"
rm "$work/app/ism.hpp"
echo "a plain copy: works"

build subdirectory -DISM_FOLDER="$project" -DISM_TARGET=ism::ism
for target in ism header; do
  if [ "$target" = ism ]; then
    "$cmake" -S "$project" -B "$work/package" -DCMAKE_CXX_COMPILER="$compiler" \
      -DISM_BUILD_EXAMPLES=OFF -DISM_BUILD_TESTS=OFF > /dev/null
    "$cmake" --install "$work/package" --prefix "$work/prefix" > /dev/null
    mv "$work/prefix" "$work/moved"
  fi
  build "package-$target" -DCMAKE_PREFIX_PATH="$work/moved" -DISM_TARGET="ism::$target"
done

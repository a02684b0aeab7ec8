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
cp "$project/tests/embedded_main.cpp" "$work/app/main.cpp"
grep -v '#define ISM_IMPLEMENTATION' "$project/tests/embedded_map.cpp" > "$work/app/map.cpp"

# What find_package and a CMake target bring is read off Eigen's package, for the plain copy too.
cat > "$work/app/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.16)
project(app LANGUAGES CXX)
if(ISM_FOLDER)
  add_subdirectory("${ISM_FOLDER}" ism)
else()
  find_package(ism REQUIRED)
endif()
add_executable(app main.cpp map.cpp)
target_link_libraries(app PRIVATE ${ISM_TARGET})
if(ISM_TARGET STREQUAL "ism::header")
  set_source_files_properties(map.cpp PROPERTIES COMPILE_DEFINITIONS ISM_IMPLEMENTATION)
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
(cd "$work/app" && "$compiler" -std=c++17 $eigen -DISM_IMPLEMENTATION -c map.cpp &&
  "$compiler" -std=c++17 $eigen main.cpp map.o -pthread -o "$work/copy")
"$work/copy"
# Files with other containers must not link.
(cd "$work/app" && "$compiler" -std=c++17 $eigen -D_GLIBCXX_DEBUG -c main.cpp -o checked.o)
nm "$work/app/checked.o" > "$work/names.txt" 2> /dev/null || true
if grep -q v0_1_checked "$work/names.txt" &&
  "$compiler" "$work/app/checked.o" "$work/app/map.o" -pthread -o "$work/mixed" 2> /dev/null; then
  echo "files with checked and unchecked containers link"
  exit 1
fi
rm "$work/app/map.o" "$work/app/checked.o" "$work/app/ism.hpp"
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

#!/usr/bin/env bash
# Builds and runs a program that uses the library in every way that examples/reference.md names: the
# projects in tests/consumers/, by CMake, pkg-config and hand. All of them compile the same text,
# once.
#   test_consumers.sh CMAKE CXX_COMPILER FLAGS_OF_EIGEN...
#   EIGEN_FOLDERS="dir..."   other versions of Eigen (default: where Debian's r-cran-rcppeigen
#                            has 3.3)
set -euo pipefail

cmake="$1"
compiler="$2"
shift 2
eigen=("$@")
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
consumers="$project/tests/consumers"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
export COMPILED="$work/compiled"
mkdir "$COMPILED"
once="$consumers/compile_once.sh"
# Compiling without optimisation takes least time. -fPIC, since ism::ism has it.
flags=(-std=c++17 -fPIC)

fail() {
  [ ! -e "$work/$1.log" ] || cat "$work/$1.log"
  echo "$1: $2"
  exit 1
}

# run NAME PROGRAM
run() {
  "$2" || fail "$1" "exit code $?"
  echo "$1: works"
}

# configured NAME SOURCE ARGUMENTS...: CMake, without flags that a type of build would bring.
configured() {
  local name="$1" source="$2"
  shift 2
  "$cmake" -S "$source" -B "$work/$name" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_CXX_COMPILER_LAUNCHER="$once" -DCMAKE_BUILD_TYPE=Plain \
    -DCMAKE_CXX_FLAGS="${flags[*]}" "$@" > "$work/$name.log" 2>&1
}

# with_cmake NAME PROGRAMS ARGUMENTS...: the project of this name, and what it builds.
with_cmake() {
  local name="$1" programs="$2" program
  shift 2
  configured "$name" "$consumers/$name" "$@" || fail "$name" "cannot be configured"
  "$cmake" --build "$work/$name" >> "$work/$name.log" 2>&1 || fail "$name" "does not build"
  for program in $programs; do run "$name, $program" "$work/$name/$program"; done
}

# by_hand NAME EIGEN...: a copy of the header beside the sources.
by_hand() {
  local name="$1" folder="$work/$1"
  shift
  mkdir "$folder"
  cp "$project/ism.hpp" "$consumers/main.cpp" "$consumers/ism.cpp" "$folder"
  (cd "$folder" &&
    "$once" "$compiler" "${flags[@]}" "$@" -c main.cpp -o main.o &&
    "$once" "$compiler" "${flags[@]}" "$@" -c ism.cpp -o ism.o &&
    "$compiler" main.o ism.o -pthread -o app) > "$work/$name.log" 2>&1 ||
    fail "$name" "does not build"
  run "$name" "$folder/app"
}

# What users compile has no warnings, whatever they ask their compilers for.
warnings() {
  local other source
  for other in "$compiler" g++ clang++; do
    command -v "$other" > /dev/null || continue
    for source in "$consumers/main.cpp" "$project/examples/ism_verify.hpp"; do
      "$other" -std=c++17 -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion \
        -Wfloat-conversion -Wold-style-cast -Werror "${eigen[@]}" -I "$project" -O2 \
        -x c++ -c "$source" -o "$work/warnings.o" > "$work/warnings.log" 2>&1 ||
        fail warnings "of $other"
    done
  done
  echo "warnings: none"
}

# Files with other containers must not link.
mixed_containers() {
  cd "$work/copy"
  "$compiler" "${flags[@]}" "${eigen[@]}" -D_GLIBCXX_DEBUG -c main.cpp -o checked.o
  nm checked.o > names.txt 2> /dev/null || true
  grep -q _checked names.txt || return 0  # another standard library
  ! "$compiler" checked.o ism.o -pthread -o mixed 2> /dev/null || fail mixed_containers "they link"
  echo "mixed_containers: do not link"
}

# Packages of Eigen as some users have them: version 5, which refuses requests for version 3, is
# taken, and one that is too old is not. Nothing is compiled with them.
package_of_eigen() {
  mkdir "$work/eigen_$1"
  cat > "$work/eigen_$1/Eigen3Config.cmake" <<'CMAKE'
add_library(Eigen3::Eigen INTERFACE IMPORTED)
CMAKE
  cat > "$work/eigen_$1/Eigen3ConfigVersion.cmake" <<CMAKE
set(PACKAGE_VERSION $1)
if(NOT DEFINED PACKAGE_FIND_VERSION OR PACKAGE_FIND_VERSION_MAJOR EQUAL ${1%%.*})
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
endif()
CMAKE
}

# The installed folder is moved before it is used.
install_package() {
  package_of_eigen 3.2.10
  package_of_eigen 5.0.0
  ! configured package "$project" -DEigen3_DIR="$work/eigen_3.2.10" -DISM_BUILD_EXAMPLES=OFF \
    -DISM_BUILD_TESTS=OFF || fail package "takes Eigen 3.2"
  grep -q "needs Eigen 3.3 or newer, found 3.2.10" "$work/package.log" ||
    fail package "does not say which Eigen it needs"
  configured package "$project" -DEigen3_DIR="$work/eigen_5.0.0" -DISM_BUILD_C=OFF ||
    fail package "refuses Eigen 5"
  "$cmake" --install "$work/package" --prefix "$work/prefix" > "$work/package.log" 2>&1 ||
    fail package "cannot be installed"
  mv "$work/prefix" "$work/moved"
  echo "package: installed"
}

with_pkg_config() {
  if ! command -v pkg-config > /dev/null || ! command -v make > /dev/null; then
    echo "pkg_config: skipped, pkg-config is missing (Debian and Ubuntu: pkgconf)"
    return
  fi
  cp -r "$consumers/." "$work/pkg_config"
  CXXFLAGS="${flags[*]}" PKG_CONFIG_PATH="$work/moved/share/pkgconfig" \
    make -C "$work/pkg_config/pkg_config" CXX="$once $compiler" > "$work/pkg_config.log" 2>&1 ||
    fail pkg_config "does not build"
  run pkg_config "$work/pkg_config/pkg_config/app"
}

other_eigens() {
  local folder version
  for folder in ${EIGEN_FOLDERS:-/usr/lib/R/site-library/RcppEigen/include}; do
    if [ ! -e "$folder/Eigen/Core" ]; then
      echo "eigen: skipped, $folder is missing (Debian and Ubuntu: r-cran-rcppeigen)"
      continue
    fi
    version="$(sed -nE 's/^#define EIGEN_(WORLD|MAJOR|MINOR)_VERSION ([0-9]+).*/\2/p' \
      "$folder/Eigen/src/Core/util/Macros.h" | paste -sd .)"
    by_hand "eigen_$version" -isystem "$folder"
  done
}

# Two at a time.
(
  with_cmake add_subdirectory app
  with_cmake fetch_content app
  other_eigens
) &
others=$!
(
  install_package
  by_hand copy "${eigen[@]}"
  mixed_containers
  warnings
  with_cmake find_package "app app_header" -DCMAKE_PREFIX_PATH="$work/moved"
  with_pkg_config
) &
status=0
wait $! || status=1
wait $others || status=1
exit $status

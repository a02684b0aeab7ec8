#!/usr/bin/env bash
# The packages of examples/packaging/, without vcpkg and Conan: stand-ins for both, of which
# tests/consumers/packages/ has what these packages use, run the port and the recipe. Then a program
# finds each package and runs.
#   test_packaging.sh CMAKE CXX_COMPILER EIGEN3_DIR
set -euo pipefail

cmake="$1"
compiler="$2"
eigen="$3"
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
packaging="$project/examples/packaging"
consumers="$project/tests/consumers"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
export COMPILED="$work/compiled"
mkdir "$COMPILED"
# Compiling without optimisation takes least time; both packages compile the same text, once.
arguments=(-DCMAKE_CXX_COMPILER="$compiler" -DEigen3_DIR="$eigen" -DCMAKE_BUILD_TYPE=Plain
  -DCMAKE_CXX_COMPILER_LAUNCHER="$consumers/compile_once.sh" -DCMAKE_CXX_FLAGS="-std=c++17 -fPIC")
version="$(sed -nE 's/^#define ISM_VERSION_[A-Z]+ +([0-9]+).*/\1/p' "$project/ism.hpp" |
  paste -sd . -)"

fail() {
  [ ! -e "$work/log" ] || cat "$work/log"
  echo "FAILED: $*" >&2
  exit 1
}

# consume NAME PREFIX PROGRAM...: a project that finds the package.
consume() {
  local name="$1" prefix="$2" program
  shift 2
  "$cmake" -S "$consumers/find_package" -B "$work/$name" -DCMAKE_PREFIX_PATH="$prefix" \
    "${arguments[@]}" > "$work/log" 2>&1 || fail "$name: not found"
  for program in "$@"; do
    "$cmake" --build "$work/$name" --target "$program" >> "$work/log" 2>&1 ||
      fail "$name: $program does not build"
    "$work/$name/$program" || fail "$name: $program ends with $?"
  done
  echo "$name: works"
}

vcpkg_port() {
  local port="$packaging/vcpkg/ism-hpp"
  grep -q "\"version\": \"$version\"" "$port/vcpkg.json" || fail "the port has another version"
  "$cmake" -DPORT_DIR="$port" -DWORK="$work/vcpkg_work" \
    "-DARGUMENTS=$(IFS=';' && echo "${arguments[*]}")" -P "$consumers/packages/vcpkg.cmake" \
    > "$work/log" 2>&1 || fail "the port cannot be installed"
  mv "$work/vcpkg_work/packages" "$work/installed"
  (cd "$work/installed" && find . -type f | sort) > "$work/files"
  diff "$work/files" - <<'FILES' || fail "the port installs something else"
./include/ism.hpp
./include/ism_verify.hpp
./share/ism-hpp/copyright
./share/ism/ismConfig.cmake
./share/ism/ismConfigVersion.cmake
./share/ism/ismTargets.cmake
./share/pkgconfig/ism.pc
FILES
  consume vcpkg "$work/installed" app app_header
}

conan_recipe() {
  if ! command -v python3 > /dev/null; then
    echo "conan: skipped, python3 is missing"
    return
  fi
  PYTHONDONTWRITEBYTECODE=1 python3 "$consumers/packages/conan.py" \
    "$packaging/conan/conanfile.py" "$work/conan_work" "$cmake" "${arguments[@]}" \
    > "$work/log" 2>&1 || fail "the recipe makes no package"
  grep -q "^ism-hpp/$version, which requires eigen/" "$work/log" || fail "the recipe's version"
  mv "$work/conan_work/source" "$work/conan_work/build" "$work/compiled"  # none is needed any more
  (cd "$work/conan_work/package" && find . -type f | sort) > "$work/files"
  diff "$work/files" - <<'FILES' || fail "the recipe packages something else"
./include/ism.hpp
./include/ism_verify.hpp
./lib/libism.a
./licenses/LICENSE
FILES
  consume conan "$work/conan_work/deps" app app_header
}

vcpkg_port
conan_recipe

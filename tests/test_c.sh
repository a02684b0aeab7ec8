#!/usr/bin/env bash
# The C interface from outside: a program in C and one in C# must print what the one in C++ does, and
# a program that calls everything with bad input must get a status each time, also with sanitizers.
#   test_c.sh CMAKE BUILD_FOLDER CXX_COMPILER LIBISM_C LIBISM QUICK_START FLAGS_OF_EIGEN...
set -euo pipefail

cmake="$1"
build="$2"
compiler="$3"
shared="$4"
static="$5"
quick_start="$6"
shift 6
eigen=("$@")
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
c="$project/examples/c"
data="$project/data"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cc="${CC:-cc}"
strict=(-std=c99 -pedantic -Wall -Wextra -Werror)
folder="$(dirname "$shared")"
export LD_LIBRARY_PATH="$folder" DYLD_LIBRARY_PATH="$folder"

fail() {
  [ ! -e "$work/log" ] || cat "$work/log"
  echo "FAILED: $*" >&2
  exit 1
}

# same NAME FILE FILE: the files differ in spaces at most.
same() { diff -b "$work/$2" "$work/$3" || fail "$1"; }

files() { echo "$data/$1/A.obj" "$data/$1/B.obj" "$data/$1/landmarks.txt"; }

# The shared library has the functions of its header, and nothing else that programs could find.
names() {
  local declared exported
  command -v nm > /dev/null && [ "$(uname)" = Linux ] || return 0
  declared="$(sed -nE 's/^[a-z].*[ *](ism_[a-z_]+)\(.*/\1/p' "$c/ism_c.h" | sort)"
  exported="$(nm -D --defined-only "$shared" | sed 's/.* //' | sort)"
  [ "$declared" = "$exported" ] || fail "the library exports: $exported"
  echo "names: those of the header"
}

# Installed and moved, then used by CMake.
c_program() {
  "$cmake" --install "$build" --prefix "$work/prefix" > "$work/log" 2>&1 || fail "no installation"
  mv "$work/prefix" "$work/moved"
  "$cmake" -S "$project/tests/consumers/c" -B "$work/consumer" -DCMAKE_C_COMPILER="$cc" \
    -DCMAKE_PREFIX_PATH="$work/moved" > "$work/log" 2>&1 &&
    "$cmake" --build "$work/consumer" >> "$work/log" 2>&1 || fail "map_hands does not build"
  # shellcheck disable=SC2046
  "$work/consumer/map_hands" $(files hand) > "$work/c" 2> "$work/log" &&
    "$quick_start" $(files hand) > "$work/cpp" || fail "a program ended with an error"
  head -n 3 "$work/c" > "$work/c_head"
  same "C and C++ differ" c_head cpp
  echo "map_hands: as in C++"
  sed 's/^/  /' "$work/c"
}

cs_program() {
  if ! command -v mcs > /dev/null || ! command -v mono > /dev/null; then
    echo "MapHands: skipped, mcs is missing (Debian and Ubuntu: mono-mcs)"
    return
  fi
  mcs -warnaserror -warn:4 -out:"$work/MapHands.exe" "$c/MapHands.cs" > "$work/log" ||
    fail "MapHands.cs does not build"
  # shellcheck disable=SC2046
  mono "$work/MapHands.exe" $(files starfish) > "$work/cs" 2> "$work/log" &&
    "$work/consumer/map_hands" $(files starfish) > "$work/c" 2> "$work/log" ||
    fail "a program ended with an error"
  same "C and C# differ" c cs
  echo "MapHands: as in C"
}

attacks() {
  "$cc" "${strict[@]}" -O1 -pthread -I"$c" "$project/tests/c/attack.c" "$shared" -lm \
    -o "$work/attack" > "$work/log" 2>&1 || fail "attack.c does not build"
  "$work/attack" || fail "attack"
  "$work/attack" memory || fail "attack, with little memory"
}

# The interface and the program with sanitizers; tests/lanes.sh does so with the implementation.
sanitized_attacks() {
  local flags=(-g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all -I"$c")
  echo 'int main(void) { return 0; }' > "$work/empty.c"
  if ! "$cc" "${flags[@]}" "$work/empty.c" -o "$work/empty" 2> /dev/null; then
    echo "sanitizers: skipped, the compiler has none"
    return
  fi
  "$cc" "${flags[@]}" "${strict[@]}" -c "$project/tests/c/attack.c" -o "$work/attack.o" &&
    "$compiler" -std=c++17 "${flags[@]}" -I"$project" "${eigen[@]}" "$c/ism_c.cpp" "$work/attack.o" \
      "$static" -pthread -o "$work/sanitized" > "$work/log" 2>&1 || fail "sanitizers: no program"
  "$work/sanitized" || fail "sanitizers"
}

names
c_program
cs_program
attacks
sanitized_attacks

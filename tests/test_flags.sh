#!/usr/bin/env bash
# Flags under which the predicates are not exact: each is refused by the compiler or, where no macro
# tells of it, found by arithmetic_is_sound(). And newer standards, without a warning.
#   test_flags.sh COMPILER FLAGS_OF_EIGEN...
set -euo pipefail

compiler="$1"
shift
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

cat > "$work/sound.cpp" <<'CPP'
#define ISM_IMPLEMENTATION
#include "ism.hpp"
int main() { return ism::detail::arithmetic_is_sound() ? 0 : 1; }
CPP

# compile FLAGS...: of those of this test and of Eigen.
compile() { "$compiler" -std=c++17 -I"$project" "${eigen[@]}" "$work/sound.cpp" "$@" 2> "$work/log"; }
eigen=("$@")

compile -E -o /dev/null || { cat "$work/log"; exit 1; }
for flag in -ffast-math -Ofast -ffinite-math-only; do
  if compile -E -o /dev/null "$flag"; then
    echo "$flag is not refused" >&2
    exit 1
  fi
  grep -q "decides orientations exactly" "$work/log" || { cat "$work/log"; exit 1; }
  echo "$flag: refused"
done

strict=(-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Werror)
for standard in c++20 c++2b; do
  compile -fsyntax-only "-std=$standard" "${strict[@]}" || { cat "$work/log"; exit 1; }
  echo "$standard: no warnings"
done

# Sums in another order: g++ says so by a macro, clang++ does not.
reorder=(-O2 -fassociative-math -fno-signed-zeros -fno-trapping-math)
if compile -E -o /dev/null "${reorder[@]}"; then
  compile "${reorder[@]}" -pthread -o "$work/sound"
  if "$work/sound"; then
    echo "-fassociative-math is not found" >&2
    exit 1
  fi
  echo "-fassociative-math: found when it runs"
else
  echo "-fassociative-math: refused"
fi

#!/usr/bin/env bash
# Builds hashes.cpp by every compiler at several levels, and compares what the programs print. Flags
# for a processor with fused multiplications are the only ones to change it, so there are none. What is not installed is skipped, and said to be.
#   compare.sh FOLDER [quick]   where programs are built; quick: two of them, small pairs only
#   EIGEN=dir                   where Eigen is (default: /usr/include/eigen3)
# On Debian and Ubuntu: clang g++-aarch64-linux-gnu qemu-user g++-mingw-w64-x86-64-posix wine64
# emscripten nodejs.
set -uo pipefail
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
mkdir -p "$1"
cd "$1"
export PATH="$PATH:/usr/lib/wine" WINEPREFIX="$PWD/wine" WINEDEBUG=-all
flags=(-std=c++17 -I"$project" -isystem "${EIGEN:-/usr/include/eigen3}")
small=(bent closed)
all=("${small[@]}" "$project"/data/{starfish,hand,face})
status=0
expected=""

# has NAME TOOL...: whether all are installed.
has() {
  local name="$1" tool
  shift
  for tool in "$@"; do
    command -v "$tool" > /dev/null || { echo "$name: skipped, there is no $tool"; return 1; }
  done
}

# compare NAME COMMAND...: what it prints is what the first one printed, as far as that goes.
compare() {
  local name="$1" result
  shift
  result="$("$@" | sed "s|$project/||")"
  [ -n "$expected" ] || expected="$result"
  if [ -n "$result" ] && [ "$result" = "$(head -n "$(wc -l <<< "$result")" <<< "$expected")" ]; then
    echo "$name: $(wc -l <<< "$result") pairs, the same bits"
  else
    echo "$name: FAILED"
    diff <(echo "$expected") <(echo "$result")
    status=1
  fi
}

# native COMPILER FLAGS PAIR...
native() {
  local name="$1 $2" compiler="$1" level
  read -ra level <<< "$2"
  shift 2
  has "$name" "$compiler" || return 0
  "$compiler" "${flags[@]}" "${level[@]}" -pthread "$project/tests/bits/hashes.cpp" -o hashes &&
    compare "$name" ./hashes 10 "$@" || status=1
}

if [ "${2:-}" = quick ]; then
  native g++ -O0 "${small[@]}"
  native clang++ -O0 "${small[@]}"
  exit $status
fi
native g++ -O2 "${all[@]}"
for level in -O0 -O3; do native g++ "$level" "${all[@]}"; done
for level in -O0 -O2 -O3; do native clang++ "$level" "${all[@]}"; done
if grep -qw avx /proc/cpuinfo; then native g++ "-O2 -mavx" "${all[@]}"; fi  # twice as many lanes
source="$project/tests/bits/hashes.cpp"
if has aarch64 aarch64-linux-gnu-g++ qemu-aarch64; then
  aarch64-linux-gnu-g++ "${flags[@]}" -O2 -static -pthread "$source" -o hashes_arm &&
    compare aarch64 qemu-aarch64 ./hashes_arm 10 "${small[@]}" || status=1
fi
if has WebAssembly em++ node; then  # linking with optimisation needs more tools; old glue trips on fetch
  em++ "${flags[@]}" -O2 -DISM_NO_THREADS -c "$source" -o hashes.o &&
    em++ hashes.o -sNODERAWFS=1 -sALLOW_MEMORY_GROWTH=1 -sTOTAL_STACK=1MB -o hashes.js &&
    compare WebAssembly node --no-experimental-fetch hashes.js 10 "${all[@]}" || status=1
fi
if has Windows x86_64-w64-mingw32-g++-posix wine64; then
  x86_64-w64-mingw32-g++-posix "${flags[@]}" -O2 -static "$source" -o hashes.exe &&
    compare Windows wine64 hashes.exe 10 "${all[@]}" || status=1
fi
exit $status

#!/usr/bin/env bash
# Cross-compiles the library and programs that use it for Windows, and runs them where Wine is
# installed. Exit code 77: the cross compiler is missing. `tests/lanes.sh windows` runs all tests.
#   test_windows.sh CMAKE EIGEN3_DIR   the folder of Eigen's CMake package
set -euo pipefail

cmake="$1"
eigen="$2"
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
if ! command -v x86_64-w64-mingw32-g++-posix > /dev/null; then
  echo "skipped: the cross compiler is missing (Debian and Ubuntu: g++-mingw-w64-x86-64-posix)"
  exit 77
fi
work="$(mktemp -d)"
export PATH="$PATH:/usr/lib/wine" WINEPREFIX="$work/wine" WINEDEBUG=-all
clean_up() {
  [ ! -e "$WINEPREFIX" ] || wineserver -w || true  # it writes there until it ends
  rm -rf "$work"
}
trap clean_up EXIT

# Headers alone, so that the compiler does not find what else is in /usr/include.
mkdir "$work/include"
ln -s /usr/include/nlohmann "$work/include"
"$cmake" -S "$project" -B "$work/build" -DISM_BUILD_TESTS=OFF -DISM_NATIVE=OFF \
  -DISM_STB_DIR=/usr/include/stb -DISM_JSON_DIR="$work/include" \
  -DCMAKE_TOOLCHAIN_FILE="$project/tests/consumers/mingw.cmake" -DEigen3_DIR="$eigen" \
  -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS_RELEASE="-O1 -Werror" > "$work/log" 2>&1 &&
  "$cmake" --build "$work/build" --target ism_map --target quick_start --target ism_c \
    >> "$work/log" 2>&1 &&
  x86_64-w64-mingw32-gcc-posix -std=c99 -pedantic -Wall -Wextra -Werror -I "$project/examples/c" \
    "$project/examples/c/map_hands.c" "$work/build/ism_c.dll" -o "$work/build/map_hands.exe" \
    >> "$work/log" 2>&1 || {
  cat "$work/log"
  exit 1
}
echo "ism_map, quick_start, ism_c: built"

wine="$(sed -n 's/^ISM_WINE:FILEPATH=//p' "$work/build/CMakeCache.txt")"
if [[ "$wine" == *NOTFOUND* ]]; then
  echo "not run: Wine is missing (Debian and Ubuntu: wine64)"
  exit
fi
pair="$project/data/starfish"
cd "$work"
"$wine" build/quick_start.exe "$pair/A.obj" "$pair/B.obj" "$pair/landmarks.txt" > quick_start.txt
grep "is an isometry" quick_start.txt
"$wine" build/map_hands.exe "$pair/A.obj" "$pair/B.obj" "$pair/landmarks.txt" > map_hands.txt \
  2> map_hands.log
diff -b <(head -n 3 map_hands.txt) quick_start.txt
"$wine" build/ism_map.exe "$pair/A.obj" "$pair/B.obj" --landmarks "$pair/landmarks.txt" \
  --iterations 3 --picture -o out
for file in out/*; do [ -s "$file" ] || { echo "$file is empty" && exit 1; }; done
[ "$(find out -name '*.tmp')" = "" ]
echo "ism_map, quick_start, map_hands: work"

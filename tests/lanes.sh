#!/usr/bin/env bash
# Builds and tests in every way that users may: compilers, standards, flags, sanitizers. All of them
# take hours on two processors.
#   tests/lanes.sh [LANE...]   the lanes named, or all; prints a line for each
#   BUILD=dir                  the folder of their build folders and logs (default: build/lanes)
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root="${BUILD:-build/lanes}"
mkdir -p "$root"
root="$(cd "$root" && pwd)"
chosen=" $* "
failed=0

wanted() { [ "$chosen" = "  " ] || [[ "$chosen" == *" $1 "* ]]; }

# report NAME STATUS START TEXT
report() {
  local result=passed
  [ "$2" -eq 0 ] || { result="FAILED, see $root/$1.log" && failed=1; }
  echo "$1: $result in $((SECONDS - $3)) s. $4"
}

# lane NAME COMPILER FLAGS LEFT_OUT ARGUMENTS...: tests/run.sh with these flags of the compiler and
# arguments of CMake, but for the tests left out.
lane() {
  local name="$1" compiler="$2" flags="$3" left_out="$4" start=$SECONDS
  shift 4
  wanted "$name" || return 0
  CXX="$compiler" CXXFLAGS="-Werror $flags" BUILD="$root/$name" EXCLUDE="$left_out" \
    tests/run.sh "$@" > "$root/$name.log" 2>&1
  report "$name" $? "$start" "$(grep -E 'tests passed|tests failed' "$root/$name.log" | tail -n 1)"
}

# The same bits by all compilers, for all systems.
same_bits() {
  local start=$SECONDS status
  wanted bits || return 0
  EIGEN="${EIGEN:-/usr/include/eigen3}" tests/bits/compare.sh "$root/bits" 2> "$root/bits.log" |
    tee -a "$root/bits.log"
  status=$?
  report bits $status "$start" ""
}

# Windows programs, cross-compiled, under Wine. The headers of doctest and Boost are linked into a
# folder of their own: the one they share with those of this system is not for that compiler.
windows() {
  local headers="$root/windows_headers" folder
  wanted windows || return 0
  if ! command -v x86_64-w64-mingw32-g++-posix > /dev/null || ! PATH="$PATH:/usr/lib/wine" \
    command -v wine64 > /dev/null; then
    echo "windows: skipped, it needs g++-mingw-w64-x86-64-posix and wine64 (of Debian and Ubuntu)"
    return
  fi
  mkdir -p "$headers"
  for folder in doctest boost; do ln -sfn "/usr/include/$folder" "$headers/$folder"; done
  export WINEPREFIX="$root/wine" WINEDEBUG=-all
  lane windows x86_64-w64-mingw32-g++-posix "" "$scripts" -DISM_NATIVE=OFF "${lean[@]}" \
    -DCMAKE_TOOLCHAIN_FILE="$PWD/tests/consumers/mingw.cmake" -DISM_DOCTEST_DIR="$headers" \
    -DISM_BOOST_DIR="$headers" -DISM_STB_DIR=/usr/include/stb \
    -DEigen3_DIR="${EIGEN3_DIR:-/usr/share/eigen3/cmake}"
}

# The oldest Eigen, as Debian has it in a package for R.
eigen33() {
  local package="$root/eigen33_package" folder=usr/lib/R/site-library/RcppEigen/include
  wanted eigen33 || return 0
  mkdir -p "$package"
  [ -e "$package/$folder" ] || (cd "$package" && apt-get download r-cran-rcppeigen &&
    dpkg-deb -x r-cran-rcppeigen_*.deb .) > "$root/eigen33.log" 2>&1 || {
    echo "eigen33: skipped, there is no package r-cran-rcppeigen"
    return
  }
  cat > "$package/Eigen3Config.cmake" <<CMAKE
set(Eigen3_VERSION 3.3.9)
add_library(Eigen3::Eigen INTERFACE IMPORTED)
set_target_properties(Eigen3::Eigen PROPERTIES INTERFACE_INCLUDE_DIRECTORIES
  "$package/$folder")
CMAKE
  lane eigen33 g++ "" "$scripts" -DISM_NATIVE=OFF "${lean[@]}" -DEigen3_DIR="$package"
}

# What needs whole builds of its own, or takes memory at will, is not for every lane; nor are the
# examples, where a lane is about the header.
scripts='test_c$|test_python|test_consumers|test_windows|test_flags|test_cli|test_web|reference'
scripts+='|test_module|test_packaging'
memory='test_machine|test_failures'
lean=(-DISM_BUILD_BENCH=OFF -DISM_BUILD_EXAMPLES=OFF)
sanitizer=(-DCMAKE_BUILD_TYPE=None -DISM_NATIVE=OFF -DISM_BUILD_BENCH=OFF)
export UBSAN_OPTIONS=print_stacktrace=1

lane native g++ "" ""
lane portable g++ "" "$scripts" -DISM_NATIVE=OFF -DISM_BUILD_BENCH=OFF
lane cxx20 g++ "" "$scripts" -DCMAKE_CXX_STANDARD=20 -DISM_NATIVE=OFF \
  "${lean[@]}"
lane clang clang++ "" "$scripts"
lane clang_cxx23_portable clang++ "" "$scripts" -DCMAKE_CXX_STANDARD=23 -DISM_NATIVE=OFF "${lean[@]}"
lane no_threads g++ "-DISM_NO_THREADS" "$scripts|$memory" "${lean[@]}"
lane address clang++ "-O2 -gline-tables-only -fsanitize=address,undefined -fno-sanitize-recover=all" \
  "$scripts|$memory" "${sanitizer[@]}"
lane thread clang++ "-O2 -gline-tables-only -fsanitize=thread" "$scripts|$memory" "${sanitizer[@]}" "${lean[@]}"
same_bits
eigen33
windows
exit $failed

#!/usr/bin/env bash
# Maps one hand onto another, from any folder: builds ism_map and runs it on data/hand. On Debian
# and Ubuntu it installs what is missing. Another pair of data/: demo.sh starfish
#   BUILD=dir  the build folder (default: build/ of the project)
#   OUT=dir    where the results go (default: out/ of the project)
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
pair="${1:-hand}"
build="${BUILD:-build}"
out="${OUT:-$PWD/out}/$pair"
if [ ! -f "data/$pair/A.obj" ]; then
  echo "There is no pair data/$pair, choose one of: $(cd data && echo */)" >&2
  exit 2
fi

# install PACKAGE COMMAND...: installs the package unless the command succeeds.
install() {
  local package="$1"
  shift
  if "$@" >/dev/null 2>&1; then return; fi
  local apt=(apt-get)
  if [ "$(id -u)" -ne 0 ]; then apt=(sudo apt-get); fi
  if ! command -v apt-get >/dev/null || ! command -v "${apt[0]}" >/dev/null; then
    echo "Please install what Debian and Ubuntu call '$package', then run this again." >&2
    exit 1
  fi
  if ! "${apt[@]}" install -y "$package"; then
    "${apt[@]}" update  # the list of packages may be old or missing
    "${apt[@]}" install -y "$package"
  fi
}

# has_header FILE [FOLDER]: whether the compiler finds a header, also in a folder of its own.
has_header() {
  echo "#include <$1>" | c++ -std=c++17 -fsyntax-only -x c++ -I/usr/include/"${2:-}" \
    -I/usr/local/include/"${2:-}" -I/opt/homebrew/include/"${2:-}" -
}

install g++ command -v c++
install make command -v make
install cmake command -v cmake
install libeigen3-dev has_header Eigen/Core eigen3

cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=Release -DISM_BUILD_EXAMPLES=ON
echo "Compiling ism_map, which takes about a minute ..."
cmake --build "$build" --target ism_map

echo
echo "Mapping data/$pair/A.obj onto data/$pair/B.obj:"
"$build/ism_map" "data/$pair/A.obj" "data/$pair/B.obj" --landmarks "data/$pair/landmarks.txt" \
  -o "$out"
echo
echo "Open $out/A_on_B.obj and data/$pair/B.obj together in a mesh viewer to see the map."

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

source .ci/packages.sh

cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=Release -DISM_BUILD_EXAMPLES=ON
echo "Compiling ism_map, which takes about a minute ..."
cmake --build "$build" --target ism_map

echo
echo "Mapping data/$pair/A.obj onto data/$pair/B.obj:"
"$build/ism_map" "data/$pair/A.obj" "data/$pair/B.obj" --landmarks "data/$pair/landmarks.txt" \
  --picture -o "$out"
echo
echo "Look at $out/picture.png, or open $out/A_on_B.obj and"
echo "data/$pair/B.obj together in a mesh viewer to see the map."

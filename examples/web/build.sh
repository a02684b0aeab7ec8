#!/usr/bin/env bash
# Makes the page: ism.hpp compiled to WebAssembly, and all that belongs to it, in one file that runs
# from any server and from the file system. On Debian and Ubuntu it installs what is missing.
#   BUILD=dir  where it is made (default: build/web of the project); the page is BUILD/index.html
#   EIGEN=dir, STB=dir  the folders with Eigen/Core and with stb_image.h, if they are elsewhere
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build="${BUILD:-build/web}"
source .ci/packages.sh
install emscripten command -v em++
install nodejs command -v node
[ "$(command -v em++)" != /usr/bin/em++ ] || install node-acorn test -d /usr/share/nodejs/acorn
export NODE_PATH="/usr/share/nodejs${NODE_PATH:+:$NODE_PATH}"  # of a node that is not Debian's
# Headers alone: what else is in /usr/include is of another system.
eigen="${EIGEN:-/usr/include/eigen3}"
stb="${STB:-/usr/include/stb}"

mkdir -p "$build"
flags=(-std=c++17 -O2 -msimd128 -DISM_NO_THREADS -fno-rtti -Wall -Wextra
       -DEMSCRIPTEN_HAS_UNBOUND_TYPE_NAMES=0 -I. -isystem "$eigen" -isystem "$stb")
[ -e "$build/ism.cpp" ] || printf '#define ISM_IMPLEMENTATION\n#include "ism.hpp"\n' > "$build/ism.cpp"

# compile SOURCE...: those that changed, or whose headers did.
compile() {
  local source object
  for source in "$@"; do
    object="$build/$(basename "$source" .cpp).o"
    if [ ! -e "$object" ] || [ -n "$(find ism.hpp examples "$source" -newer "$object" \
        \( -name '*.hpp' -o -path "$source" \))" ]; then
      echo "Compiling $source ..."
      em++ "${flags[@]}" -c "$source" -o "$object"
    fi
  done
}
compile "$build/ism.cpp" examples/map_picture.cpp examples/web/session.cpp
em++ -O2 -msimd128 -fno-rtti --bind "$build"/{ism,map_picture,session}.o \
  -sTOTAL_STACK=8MB -sALLOW_MEMORY_GROWTH -sMODULARIZE -sEXPORT_NAME=createIsm \
  -sEXPORTED_RUNTIME_METHODS=FS -sENVIRONMENT=worker,node -o "$build/ism.js"
node examples/web/pack.js examples/web "$build" data "$build/index.html"
echo "The page is $build/index.html: $(wc -c < "$build/index.html") bytes," \
  "$(gzip -9 -c "$build/index.html" | wc -c) compressed."

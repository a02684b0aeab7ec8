#!/usr/bin/env bash
# Compiles ism.hpp to WebAssembly, and makes of it
#   BUILD/index.html  the page, one file that runs from any server and from the file system
#   BUILD/module/     the module, a folder to import from; with npm, also a package, BUILD/*.tgz
# On Debian and Ubuntu it installs what is missing, but for npm.
#   BUILD=dir  where they are made (default: build/web of the project)
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
  -sEXPORTED_RUNTIME_METHODS=FS -sENVIRONMENT=worker,node -sDYNAMIC_EXECUTION=0 \
  -sNODEJS_CATCH_EXIT=0 -sNODEJS_CATCH_REJECTION=0 -o "$build/ism.js"
cat "$build/ism.js" examples/web/worker.js > "$build/worker.js"

# size FILE: in bytes, as it is and compressed.
size() { echo "$(wc -c < "$1") bytes, $(gzip -9 -c "$1" | wc -c) compressed"; }

node examples/web/pack.js examples/web "$build" data "$build/index.html"
echo "The page is $build/index.html: $(size "$build/index.html")."

module="$build/module"
rm -rf "$module" "$build"/*.tgz
mkdir "$module"
cp "$build"/{worker.js,ism.wasm} examples/web/engine.mjs examples/web/module/{ism.mjs,ism.d.mts} \
  examples/web/module/README.md LICENSE "$module"
# The version stands in the header only.
version="$(sed -nE 's/^#define ISM_VERSION_[A-Z]+ +([0-9]+).*/\1/p' ism.hpp | paste -sd . -)"
sed "s/@version@/$version/" examples/web/module/package.json > "$module/package.json"
echo "The module is $module; ism.wasm: $(size "$module/ism.wasm")."
if command -v npm > /dev/null; then
  package="$(cd "$build" && npm pack --silent --offline ./module)"
  echo "The package is $build/$package: $(wc -c < "$build/$package") bytes."
fi

#!/usr/bin/env bash
# Builds the module of examples/web/module/, installs its package, and tries it in node, and in
# Chromium if there is one. Exit code 77: something is missing; npm may be.
#   test_module.sh QUICK_START FOLDER   the program in C++ to compare with, and where all is made
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
project="$PWD"
quick_start="$1"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

for tool in em++ node; do
  command -v "$tool" > /dev/null && continue
  echo "skipped: $tool is missing (Debian and Ubuntu: emscripten, nodejs)"
  exit 77
done

NO_INSTALL=1 BUILD="$2" examples/web/build.sh
built="$(cd "$2" && pwd)"
cd "$work"  # as users have it
if command -v npm > /dev/null; then
  echo '{"private": true}' > package.json
  npm install --silent --offline --no-audit --no-fund "$built"/ism-hpp-*.tgz
else
  echo "npm: skipped, it is missing (Debian and Ubuntu: npm)"
  mkdir node_modules
  cp -r "$built/module" node_modules/ism-hpp
fi
# shellcheck disable=SC2012
[ "$(ls node_modules/ism-hpp | paste -sd ' ')" = \
  "LICENSE README.md engine.mjs ism.d.mts ism.mjs ism.wasm package.json worker.js" ]
cp "$project/tests/consumers/module/"* .
node use.mjs
if command -v tsc > /dev/null; then
  for resolution in "nodenext --module nodenext" "bundler --module esnext"; do
    # shellcheck disable=SC2086
    tsc --noEmit --strict --target es2022 --lib es2022,dom use.mts --moduleResolution $resolution
  done
  echo "passed: types"
else
  echo "types: skipped, tsc is missing (Debian and Ubuntu: node-typescript)"
fi
chromium="$(command -v chromium chromium-browser google-chrome | head -n 1 || true)"
[ -n "$chromium" ] || echo "browser: skipped, chromium is missing (Debian and Ubuntu: chromium)"
node "$project/tests/test_module.mjs" node_modules/ism-hpp "$project/data" "$quick_start" \
  "$chromium"

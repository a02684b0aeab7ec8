#!/usr/bin/env bash
# Builds the module of examples/web/module/, installs its package, and tries it in node, and in
# Chromium if there is one. Exit code 77: something is missing.
#   test_module.sh QUICK_START FOLDER   the program in C++ to compare with, and where all is made
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
project="$PWD"
quick_start="$1"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

for tool in em++ node npm; do
  command -v "$tool" > /dev/null && continue
  echo "skipped: $tool is missing (Debian and Ubuntu: emscripten, nodejs, npm)"
  exit 77
done

NO_INSTALL=1 BUILD="$2" examples/web/build.sh
package="$(cd "$2" && echo "$PWD"/ism-hpp-*.tgz)"
tar -tzf "$package" | sort > "$work/files"
diff "$work/files" - <<'FILES'
package/LICENSE
package/README.md
package/engine.mjs
package/ism.d.mts
package/ism.mjs
package/ism.wasm
package/package.json
package/worker.js
FILES

cd "$work"  # as users have it
echo '{"private": true}' > package.json
npm install --silent --offline --no-audit --no-fund "$package"
cp "$project/tests/consumers/module/"* .
node use.mjs
if command -v tsc > /dev/null; then
  for resolution in "nodenext --module nodenext" "bundler --module esnext"; do
    # shellcheck disable=SC2086
    tsc --noEmit --strict --target es2022 --lib es2022,dom --moduleResolution $resolution use.mts
  done
  echo "passed: types"
else
  echo "types: skipped, tsc is missing (Debian and Ubuntu: node-typescript)"
fi
chromium="$(command -v chromium chromium-browser google-chrome | head -n 1 || true)"
[ -n "$chromium" ] || echo "browser: skipped, chromium is missing (Debian and Ubuntu: chromium)"
node "$project/tests/test_module.mjs" node_modules/ism-hpp "$project/data" "$quick_start" "$chromium"

#!/usr/bin/env bash
# The add-on of examples/blender in Blender: packs the zip, installs it for a user of its own, and
# runs its tests; with xvfb also those in a window. Exit code 77: Blender is missing.
#   test_blender.sh LIBRARY
#   BLENDER=blender   the program
set -euo pipefail

library="$1"
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
addon="$project/examples/blender"
blender="${BLENDER:-blender}"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
export TMPDIR="$work"

if ! command -v "$blender" > /dev/null; then
  echo "skipped: there is no $blender (Debian and Ubuntu: blender python3-numpy)"
  exit 77
fi
if ! "$blender" -b --factory-startup --python-exit-code 1 --python-expr "import numpy" \
  > "$work/log" 2>&1; then
  echo "skipped: $blender does not start, or has no numpy (Debian and Ubuntu: python3-numpy)"
  cat "$work/log"
  exit 77
fi

# run TEST COMMAND...: with the zip installed into a new folder.
run() {
  local test="$addon/tests/$1"
  shift
  rm -rf "$work/scripts"
  mkdir "$work/scripts"
  BLENDER_USER_SCRIPTS="$work/scripts" "$@" --factory-startup --python-exit-code 1 -P "$test" \
    -- "$work/addon.zip" "$project/data" > "$work/log" 2>&1 || { cat "$work/log"; return 1; }
}

python3 -B "$addon/make_zip.py" --library "$library" -o "$work/addon.zip"
run test_addon.py timeout 200 "$blender" -b
grep -oE "cancel, .*|^Ran .*|^OK" "$work/log"
if command -v xvfb-run > /dev/null; then
  run test_window.py timeout 100 xvfb-run -a -s "-screen 0 1280x900x24" "$blender" \
    --enable-event-simulate
  grep -E "^(while|Esc|window)" "$work/log"
  grep -q "^window: ok" "$work/log"
  if grep -A 9 Traceback "$work/log"; then exit 1; fi  # e.g. of the panel
else
  echo "the window: skipped, xvfb-run is missing (Debian and Ubuntu: xvfb)"
fi

#!/usr/bin/env bash
# Builds the page of examples/web/ and tries it in a browser without a screen.
#   test_web.sh ISM_MAP FOLDER   the native program to compare with, and where all is made
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
NO_INSTALL=1 BUILD="$2" examples/web/build.sh
node tests/test_web.js "$2/index.html" "$1" data "$2/seen"

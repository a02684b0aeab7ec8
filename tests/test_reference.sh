#!/usr/bin/env bash
# Makes the reference, without a warning, and looks for what a reader looks for. Exit code 77:
# Doxygen is missing.
#   test_reference.sh DOXYGEN DOXYFILE   as CMake's target ism_reference has them
set -euo pipefail

doxygen="$1"
doxyfile="$2"
if ! command -v "$doxygen" > /dev/null; then
  echo "skipped: Doxygen is missing (Debian and Ubuntu: doxygen)"
  exit 77
fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."
pages="$(dirname "$doxyfile")/reference/html"
rm -rf "$pages"
"$doxygen" "$doxyfile"
cd "$pages"

# has PAGE TEXT
has() { grep -qi "$2" "$1" || { echo "$1: no '$2'" && exit 1; }; }

for name in compute_map Solver Options SurfaceMap; do
  has index.html "<a class=\"el\" href=[^>]*>ism::$name"
done
# The comments above and behind declarations, and below those behind.
has namespaceism.html "then Algorithm 1"
has namespaceism.html "stopping rule of"
has namespaceism.html "the overlay has more than 16 million polygons"
has structism_1_1Options.html "reward for covered area"
has structism_1_1Options.html "replaces std::thread"
has classism_1_1Solver.html "<pre class=\"fragment\"> *ism::Solver solver(a, b"
if grep -rlE "namespaceism_1_1detail|ISM_ABI|ISM_HPP_IMPLEMENTED|ISM_UNROLL" .; then
  echo "these pages have what a reader does not need"
  exit 1
fi
echo "the reference: no warnings"

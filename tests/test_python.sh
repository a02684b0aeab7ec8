#!/usr/bin/env bash
# The Python package from outside: installs it by pip into a fresh environment, runs its tests and
# its example there. Exit code 77: something is missing.
#   test_python.sh CMAKE CXX_COMPILER
#   PYTHON=python   an interpreter that has numpy and pytest (default: python3 of the system)
set -euo pipefail

cmake="$1"
export CXX="$2"
project="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
package="$project/examples/python"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
PATH="$(dirname "$cmake"):$PATH"
export PATH PIP_DISABLE_PIP_VERSION_CHECK=1
export CMAKE_ARGS="-DCMAKE_CXX_FLAGS_RELEASE=-O1"  # compiles sooner
python="${PYTHON:-/usr/bin/python3}"
[ -x "$(command -v "$python")" ] || python=python3

fail() {
  cat "$work/log"
  echo "FAILED: $*" >&2
  exit 1
}

# needs PACKAGE MODULE: Debian and Ubuntu call the package so.
needs() {
  "$python" -c "import $2" > /dev/null 2>&1 && return
  echo "skipped: $python has no $2 (Debian and Ubuntu: $1)"
  exit 77
}

needs python3-numpy numpy
needs python3-pytest pytest
needs python3-pip pip
needs python3-venv ensurepip
needs python3-setuptools setuptools
needs python3-wheel wheel

# A copy, so that nothing is built in the project.
mkdir -p "$work/project/examples/c" "$work/project/examples/python"
cp "$project/ism.hpp" "$project/CMakeLists.txt" "$project/LICENSE" "$work/project"
cp "$project/examples/c/"ism_c.* "$work/project/examples/c"
(cd "$package" && cp -r src pyproject.toml setup.py "$work/project/examples/python")
ln -s "$project/data" "$work/project/data"

# Without isolation, pip takes setuptools and wheel from the system, and no network.
"$python" -m venv --system-site-packages "$work/env" > "$work/log" 2>&1 || fail "no environment"
"$work/env/bin/python" -m pip wheel --no-build-isolation --no-deps -w "$work" \
  "$work/project/examples/python" > "$work/log" 2>&1 || fail "no wheel"
wheel="$(ls "$work"/ism-*.whl)"
[[ "$wheel" == *-py3-none-* && "$wheel" != *-any.whl ]] || fail "the tag of $wheel"
"$work/env/bin/python" -m pip install --no-deps "$wheel" > "$work/log" 2>&1 || fail "pip install"
echo "$(basename "$wheel"): $(wc -c < "$wheel") bytes"

cd "$work"  # not where the sources are
env/bin/python -m pytest -q -s -p no:cacheprovider "$package/tests"
if "$python" -c "import matplotlib" > /dev/null 2>&1; then
  env/bin/python "$package/example.py" --data "$project/data/starfish" --save "$work/picture.png"
  [ -s "$work/picture.png" ] || fail "no picture"
else
  echo "example.py: skipped, matplotlib is missing (Debian and Ubuntu: python3-matplotlib)"
fi

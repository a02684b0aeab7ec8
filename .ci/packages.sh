# Sourced by the scripts that build: installs what is missing on Debian and Ubuntu.

# install PACKAGE COMMAND...: installs the package unless the command succeeds. With NO_INSTALL=1 in
# the environment, it asks for it only.
install() {
  local package="$1"
  shift
  if "$@" >/dev/null 2>&1; then return; fi
  local apt=(apt-get)
  if [ "$(id -u)" -ne 0 ]; then apt=(sudo apt-get); fi
  if [ -n "${NO_INSTALL:-}" ] || ! command -v apt-get >/dev/null ||
    ! command -v "${apt[0]}" >/dev/null; then
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
install zlib1g-dev has_header zlib.h
install libstb-dev has_header stb_image.h stb
install nlohmann-json3-dev has_header nlohmann/json.hpp

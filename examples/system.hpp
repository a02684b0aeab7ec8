// system.hpp: what C++17 does not ask a system, and systems answer in their own ways.

#pragma once

#include <cstdio>
#include <filesystem>

#ifdef _WIN32
#include <io.h>
#else
#include <unistd.h>
#endif

namespace system_calls {

/// Is somebody looking, as opposed to a file or another program?
inline bool is_terminal(std::FILE* file) {
#ifdef _WIN32
  return _isatty(_fileno(file)) != 0;
#else
  return isatty(fileno(file)) != 0;
#endif
}

/// May this program make files in a folder that exists? On Windows, it is the folder's read-only
/// mark that is asked for; what access lists forbid shows when it writes.
inline bool may_write(const std::filesystem::path& folder) {
#ifdef _WIN32
  return _waccess(folder.c_str(), 2) == 0;
#else
  return access(folder.c_str(), W_OK) == 0;
#endif
}

}  // namespace system_calls

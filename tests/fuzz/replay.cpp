// Feeds files, and all files of folders, to a fuzz target: the corpus as a test, with any compiler.
//
//   fuzz_run tests/fuzz/corpus/run

#include "fuzz.hpp"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>

namespace {

std::vector<std::string> files_in(const std::string& path) {
  std::vector<std::string> files;
  if (!std::filesystem::is_directory(path)) return {path};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path))
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

bool replay(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return false;
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());  // no room behind its end
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  int n = 0;
  for (int i = 1; i < argc; ++i)
    for (const std::string& path : files_in(argv[i])) {
      std::cout << path << std::endl;  // at once: the last one is what aborts
      if (!replay(path)) return EXIT_FAILURE;
      ++n;
    }
  std::cout << n << " inputs\n";
  return n > 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

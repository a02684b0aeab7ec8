// program.hpp: what ism_map and ism_transfer have in common: the command line, progress, Ctrl-C,
// exit codes. Part of the examples of ism.hpp.

#pragma once

#include "ism.hpp"
#include "map_picture.hpp"
#include "mesh_io.hpp"
#include "system.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

namespace program {

using picture::format;

/// Exit codes.
constexpr int kComputationFailed = 1;
constexpr int kBadInput = 2;

/// Reads the value of an option. Returns an error sentence, or an empty string.
inline std::string read_number(const std::string& flag, const std::string& text, double& value) {
  if (mesh_io::parse_number(text, value) && std::isfinite(value)) return {};
  return flag + " needs a number, not '" + text + "'";
}

inline std::string read_number(const std::string& flag, const std::string& text, int& value) {
  long long x = 0;
  if (!mesh_io::parse_integer(text, x) || x < 0 || x > 1000000000)
    return flag + " needs a whole number from 0, not '" + text + "'";
  value = static_cast<int>(x);
  return {};
}

inline std::string read_number(const std::string& flag, const std::string& text, bool& value) {
  if (text != "0" && text != "1") return flag + " needs 0 or 1, not '" + text + "'";
  value = text == "1";
  return {};
}

/// The options of the library that are numbers, by name.
template <class Visit>
inline void for_each_option(ism::Options& o, const Visit& visit) {
  visit("coverage_weight", o.coverage_weight);
  visit("max_iterations", o.max_iterations);
  visit("tolerance", o.tolerance);
  visit("coarsest", o.coarsest);
  visit("refine", o.refine);
  visit("candidates", o.candidates);
  visit("history_length", o.history_length);
  visit("omega_start", o.omega_start);
  visit("as_published", o.as_published);
  visit("keep_scale", o.keep_scale);
  visit("weld", o.weld);
  visit("exact_landmarks", o.exact_landmarks);
  visit("outer_a", o.outer_a);
  visit("outer_b", o.outer_b);
  visit("threads", o.threads);
}

/// NAME=VALUE
inline std::string read_setting(const std::string& text, ism::Options& options) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return "--set needs NAME=VALUE, not '" + text + "'";
  const std::string name = text.substr(0, equals), value = text.substr(equals + 1);
  bool known = false;
  std::string error;
  for_each_option(options, [&](const char* option, auto& target) {
    if (name != option) return;
    known = true;
    error = read_number("--set " + name, value, target);
  });
  if (known) return error;
  std::string names;
  for_each_option(options, [&](const char* option, auto&) { names += ' ' + std::string(option); });
  return "--set: there is no option '" + name + "', but these:" + names;
}

/// Reads a command line of options and two files. read_switch(word) sets an option that takes no
/// value, and is false for other words; read_value(flag, value) returns an error sentence, as this
/// function does, or an empty string.
template <class ReadSwitch, class ReadValue>
std::string read_words(const std::vector<std::string>& words,
                       const std::vector<std::string>& takes_value, const ReadSwitch& read_switch,
                       const ReadValue& read_value, std::string& file_a, std::string& file_b) {
  std::string error;
  int files = 0;
  for (std::size_t i = 0; i < words.size() && error.empty(); ++i) {
    const std::string& word = words[i];
    if (read_switch(word)) continue;
    if (std::count(takes_value.begin(), takes_value.end(), word) > 0) {
      if (i + 1 == words.size()) return word + " needs a value";
      error = read_value(word, words[++i]);
    } else if (word.size() > 1 && word[0] == '-') {
      return "unknown option '" + word + "', --help lists them";
    } else if (++files > 2) {
      return "two files are expected, '" + word + "' is one too many";
    } else {
      (files == 1 ? file_a : file_b) = word;
    }
  }
  return error;
}

/// Is a mesh a surface, once it is prepared? Returns an error sentence, or an empty string.
inline std::string check_surface(const std::string& path, const ism::TriangleMesh& mesh,
                                 const std::vector<ism::LandmarkPoint>& landmarks,
                                 const ism::Options& options) {
  const std::vector<ism::Problem> problems = ism::prepare(mesh, landmarks, options.weld).problems;
  if (problems.empty()) return {};
  std::string error = path + ": " + problems[0].message;
  if (problems.size() > 1) error += " (problem 1 of " + std::to_string(problems.size()) + ")";
  return error;
}

inline std::atomic<bool> interrupted{false};  // lock-free, so that a signal may set it

inline void on_interrupt(int) {
  interrupted = true;
  std::signal(SIGINT, SIG_DFL);  // a second Ctrl-C ends the program at once
}

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// One line on stderr: rewritten in place on a terminal, else a new one for each iteration.
class ProgressLine {
 public:
  explicit ProgressLine(bool quiet) : quiet_(quiet), terminal_(system_calls::is_terminal(stderr)) {}

  void show(const ism::Progress& progress) {
    if (quiet_) return;
    const double now = seconds_since(start_);
    if (progress.iteration) {
      if (progress.iteration->iteration == last_iteration_) return;
      last_iteration_ = progress.iteration->iteration;
      print(iteration_line(*progress.iteration, now));
    } else if (last_iteration_ < 0 && now - last_time_ > (terminal_ ? 0.1 : 2.0)) {
      last_time_ = now;
      print(progress.what + format("  %.0f%%  %.1f s", 100 * progress.fraction, now));
    }
  }
  void finish() {
    if (open_) std::fputc('\n', stderr);
    open_ = false;
  }

 private:
  static std::string iteration_line(const ism::IterationLog& it, double now) {
    return format("iteration %3d  E %.6g  distortion %.4f  coverage %.4f / %.4f", it.iteration,
                  it.energy, it.mean_distortion, it.coverage_a, it.coverage_b) +
           format("  omega %.2g  s %.3g  %.1f s", it.omega, it.step, now);
  }
  void print(const std::string& line) {
    std::fprintf(stderr, terminal_ ? "\r%s\x1b[K" : "%s\n", line.c_str());
    std::fflush(stderr);
    open_ = terminal_;
  }

  bool quiet_, terminal_, open_ = false;
  int last_iteration_ = -1;
  Clock::time_point start_ = Clock::now();
  double last_time_ = -10;
};

/// compute_map() with a line of progress; Ctrl-C ends it early, with the map so far.
inline ism::Result compute(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                           const std::vector<ism::Landmark>& landmarks, ism::Options options,
                           bool quiet) {
  ProgressLine line(quiet);
  options.progress = [&line](const ism::Progress& progress) {
    line.show(progress);
    return true;
  };
  options.stop = &interrupted;
  std::signal(SIGINT, on_interrupt);
  ism::Result result = ism::compute_map(a, b, landmarks, options);
  std::signal(SIGINT, SIG_DFL);  // nothing asks for the flag from here on
  line.finish();
  return result;
}

/// What was done to a mesh, a line for each thing.
inline void print_preparation(const std::vector<std::string>& notes, const ism::Prepared& prepared,
                              int opening) {
  for (const std::string& note : notes) std::printf("             %s\n", note.c_str());
  for (const ism::Problem& repair : prepared.repairs)
    std::printf("             %s\n", repair.message.c_str());
  if (opening >= 0) std::printf("             closed: opened at vertex %d\n", opening);
}

/// Whose fault it is that there is no map.
inline int exit_code(ism::Status status, bool own_start) {
  switch (status) {
    case ism::Status::kInvalidMesh:
    case ism::Status::kInvalidLandmarks:
    case ism::Status::kInvalidPins:
    case ism::Status::kInvalidOptions:
    case ism::Status::kInvalidPositions:
      return kBadInput;
    case ism::Status::kNoOverlap:
      return own_start ? kBadInput : kComputationFailed;
    default:
      return kComputationFailed;
  }
}

/// What was printed may be in a buffer still; a full disk shows only when it leaves that.
inline bool is_printed() { return std::fflush(stdout) == 0 && std::ferror(stdout) == 0; }

}  // namespace program

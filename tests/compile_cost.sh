#!/usr/bin/env bash
# What including the header costs: processor seconds and peak memory of the compiler, for the API
# alone and for the implementation, beside <Eigen/Core> alone in the same run.
#   RUNS=n   runs of each, of which the median counts (default: 3)
#   CHECK=1  fails unless the API costs at most 1.5 times <Eigen/Core>, and the implementation with
#            g++ -O2 at most 15 times as long and at most 700 MB
# Needs python3. Compilers that are not installed are left out.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 - "${RUNS:-3}" "${CHECK:-0}" <<'PYTHON'
import os, shutil, statistics, subprocess, sys, tempfile

RUNS, CHECK = int(sys.argv[1]), sys.argv[2] == "1"
IMPLEMENTATION = '#define ISM_IMPLEMENTATION\n#include "ism.hpp"\n'
SOURCES = {  # and the flags that CMakeLists.txt gives g++ beside
    "<Eigen/Core>": ("#include <Eigen/Core>\n", []),
    "the API": ('#include "ism.hpp"\n', []),
    "the implementation": (IMPLEMENTATION, []),
    "the same as ism::ism": (IMPLEMENTATION, ["--param=ggc-min-expand=30"]),
}


def eigen_flags():
    for folder in ("/usr/include/eigen3", "/usr/local/include/eigen3",
                   "/opt/homebrew/include/eigen3"):
        if os.path.exists(folder):
            return ["-isystem", folder]
    return []


def cost(command):
    """Processor seconds and peak memory in MB of a command and its children."""
    pid = os.posix_spawnp(command[0], command, os.environ)
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        sys.exit("compile_cost.sh: failed: " + " ".join(command))
    kilobytes = usage.ru_maxrss if sys.platform != "darwin" else usage.ru_maxrss / 1024
    return usage.ru_utime + usage.ru_stime, kilobytes / 1000


def median_cost(command):
    runs = [cost(command) for _ in range(RUNS)]
    return tuple(statistics.median(run[i] for run in runs) for i in range(2))


failures = []
print("| compiler | level | file | seconds | beside Core | peak MB | beside Core |")
print("|---|---|---|---:|---:|---:|---:|")
with tempfile.TemporaryDirectory() as folder:
    for compiler in ("g++", "clang++"):
        if not shutil.which(compiler):
            continue
        for level in ("-O0", "-O2"):
            core = None
            for name, (text, flags) in SOURCES.items():
                if flags and compiler != "g++":
                    continue
                path = os.path.join(folder, "file.cpp")
                with open(path, "w") as file:
                    file.write(text)
                seconds, memory = median_cost(
                    [compiler, "-std=c++17", level, "-I.", *eigen_flags(), *flags, "-c", path, "-o",
                     os.path.join(folder, "file.o")])
                core = core or (seconds, memory)
                ratios = seconds / core[0], memory / core[1]
                print(f"| {compiler} | {level} | {name} | {seconds:.2f} | {ratios[0]:.2f} | "
                      f"{memory:.0f} | {ratios[1]:.2f} |", flush=True)
                if name == "the API" and max(ratios) > 1.5:
                    failures.append(f"{compiler} {level}: the API costs more than 1.5 Core")
                if name == "the implementation" and compiler == "g++" and level == "-O2" and (
                        ratios[0] > 15 or memory > 700):
                    failures.append("g++ -O2: the implementation exceeds 15 Core or 700 MB")
if CHECK and failures:
    sys.exit("\n".join(failures))
PYTHON

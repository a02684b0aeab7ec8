"""Measures what Python adds to the library: python3 measure.py [QUICK_START]

QUICK_START is that program of C++, built with -DISM_NATIVE=OFF, as the library is.
"""

import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

import ism
import numpy as np

DATA = pathlib.Path(__file__).resolve().parents[3] / "data" / "hand"
FILES = [str(DATA / name) for name in ("A.obj", "B.obj", "landmarks.txt")]


def read_obj(path):
    rows = [line.split() for line in open(path)]
    vertices = [[float(x) for x in row[1:4]] for row in rows if row[:1] == ["v"]]
    faces = [[int(x.split("/")[0]) - 1 for x in row[1:4]] for row in rows if row[:1] == ["f"]]
    return np.array(vertices), np.array(faces, np.int32)


def hands():
    return read_obj(FILES[0]), read_obj(FILES[1]), np.loadtxt(FILES[2], int, usecols=(0, 1))


def timed(name, work, repeats=5):
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    print(f"{name}: {1e3 * best:.2f} ms")


def child(command):
    """Seconds of the processor, and memory, of a program."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, _, usage = os.wait4(process.pid, 0)
    process.returncode = 0  # it has been waited for
    return usage.ru_utime, usage.ru_maxrss / 1024


def compare(quick_start):
    for name, command in (
        ("C++", [quick_start] + FILES),
        ("Python", [sys.executable, __file__, "--map"]),
    ) * 2:
        seconds, memory = child(command)
        print(f"{name}: {seconds:.2f} s of the processor, {memory:.0f} MB at most")


def latencies(stop):
    """Milliseconds from a request at a random time to the end of the call."""
    a, b, landmarks = hands()
    result = []
    for i in range(12):
        run, asked = ism.Run(a, b, landmarks, tolerance=0), []

        def ask():
            asked.append(time.perf_counter())
            stop(run)

        timer = threading.Timer(random.Random(i).uniform(0.05, 6), ask)
        timer.start()
        try:
            run.advance()
        except KeyboardInterrupt:
            pass
        result.append(1e3 * (time.perf_counter() - asked[0]))
    return result


def main():
    a, b, landmarks = hands()
    if sys.argv[1:] == ["--map"]:
        print(ism.map(a, b, landmarks).distortion.mean)
        return
    if sys.argv[1:]:
        compare(sys.argv[1])
    timed("create a run, which prepares both meshes", lambda: ism.Run(a, b, landmarks))
    m = ism.map(a, b, landmarks)
    timed("images of 1,900 vertices", m.a_to_b)
    m.meta
    timed("arrays of the meta mesh", lambda: m.meta)
    timed("transfer of 3 columns", lambda: m.a_to_b.transfer(a[0]))
    for name, stop in (
        ("cancel()", lambda run: run.cancel()),
        ("Ctrl-C", lambda run: os.kill(os.getpid(), signal.SIGINT)),
    ):
        ms = latencies(stop)
        print(f"{name}: {np.median(ms):.0f} ms in the median, {max(ms):.0f} ms at most")


if __name__ == "__main__":
    main()

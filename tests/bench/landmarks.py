#!/usr/bin/env python3
"""Landmarks with errors, and what becomes of them. FOLDER, GOOD: results of ism_map, with report.json.

  landmarks.py noise GOOD SHIFT SHARE   a landmark for each vertex of A that GOOD maps, shifted by SHIFT of the
                                        diagonal of B, SHARE of them anywhere on B
  landmarks.py compare FOLDER GOOD      distortion by that of GOOD, mean distance of the images in diagonals of B
  landmarks.py curves FOLDER FILE       mean distance of images from the curves of a landmarks file, in diagonals
"""

import json
import math
import pathlib
import random
import sys


def read_obj(path):
    vertices, corners = [], set()
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            corners.update(int(w.split("/")[0]) - 1 for w in words[1:])
    return vertices, corners


def images(folder):
    """Per vertex of A that is covered, where it lies on B."""
    vertices, covered = read_obj(folder / "A_on_B.obj")
    return {v: vertices[v] for v in covered}


def diagonal(vertices):
    return math.dist([min(x) for x in zip(*vertices)], [max(x) for x in zip(*vertices)])


def noise(good, shift, share):
    b, _ = read_obj(good / "B.obj")
    lot = random.Random(1)
    for v, at in sorted(images(good).items()):
        way = [lot.gauss(0, 1) for _ in range(3)]
        to = [x + shift * diagonal(b) * w / math.hypot(*way) for x, w in zip(at, way)]
        near = min(range(len(b)), key=lambda w: math.dist(b[w], to))
        print(v, lot.randrange(len(b)) if lot.random() < share else near)


def compare(folder, good):
    here, there = images(folder), images(good)
    apart = [math.dist(here[v], there[v]) for v in here if v in there]
    distortion = [json.loads((f / "report.json").read_text())["final"]["mean_distortion"]
                  for f in (folder, good)]
    size = diagonal(read_obj(good / "B.obj")[0])
    print(f"distortion {distortion[0]:.4f}, {distortion[0] / distortion[1]:.3f} times {distortion[1]:.4f}; "
          f"images {sum(apart) / len(apart) / size:.4f} apart")


def from_segment(p, u, v):
    along = [b - a for a, b in zip(u, v)]
    t = sum((x - a) * d for x, a, d in zip(p, u, along)) / (sum(d * d for d in along) or 1)
    return math.dist(p, [a + min(1, max(0, t)) * d for a, d in zip(u, along)])


def curves(folder, file):
    b, _ = read_obj(folder / "B.obj")
    at = images(folder)
    for line in file.read_text().splitlines():
        if not line.startswith("curve"):
            continue
        of_a, of_b = ([int(v) for v in half.split()] for half in line[len("curve"):].split("|"))
        there = [b[v] for v in of_b]
        distances = [min(from_segment(at[v], u, w) for u, w in zip(there, there[1:]))
                     for v in of_a if v in at]
        print(f"{sum(distances) / len(distances) / diagonal(b):.4f} ({len(distances)} of {len(of_a)} covered)")


def main(arguments):
    commands = {"noise": (noise, (pathlib.Path, float, float)), "compare": (compare, (pathlib.Path,) * 2),
                "curves": (curves, (pathlib.Path,) * 2)}
    command, types = commands.get(arguments[0] if arguments else "", (None, ()))
    if command is None or len(arguments) != 1 + len(types):
        sys.exit(__doc__)
    command(*(of(text) for of, text in zip(types, arguments[1:])))


main(sys.argv[1:])

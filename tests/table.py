#!/usr/bin/env python3
"""Runs ism_map over all pairs of a folder and prints a Markdown table of the results.

A pair is a folder with A and B as OBJ, OFF or PLY and, if there are any, landmarks.txt. All options of ism_map
can be passed through:  table.py --extra "--kappa 0 --iterations 50" --only hand_0
(write --extra=--exact-landmarks for a single one)

Where a pair has gt.txt, lines of a vertex of A and that of B to which it belongs (OBJ files), the
column "error" is how far vertices of A end from there on average, in percent of the root of the
area of B.
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import random
import shlex
import subprocess
import sys
import tempfile

PROJECT = pathlib.Path(__file__).resolve().parent.parent
COLUMNS = ["pair", "triangles A / B", "iterations", "to 1%", "status", "distortion", "coverage A",
           "coverage B", "start landmarks", "end landmarks", "vertices added", "coarse iterations",
           "embedding s", "coarse s", "derivatives s", "assembly s", "solve s", "search s", "total s",
           "peak MB", "error", "done to A", "done to B"]


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("meshes", nargs="?", type=pathlib.Path,
                        default=PROJECT.parent / "shared" / "meshes", help="folder of the pairs")
    parser.add_argument("--program", type=pathlib.Path, default=PROJECT / "build" / "ism_map")
    parser.add_argument("--extra", default="", help="options passed to ism_map")
    parser.add_argument("--only", action="append", metavar="NAME",
                        help="run this pair; can be repeated")
    parser.add_argument("--no-landmarks", action="store_true")
    parser.add_argument("--farthest", type=int, metavar="K",
                        help="only the K landmarks that lie farthest apart on A (vertex ids, OBJ)")
    parser.add_argument("--move", type=int, metavar="SEED",
                        help="move vertices of OBJ files by 1e-9 of their coordinates at random")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time (1: honest seconds)")
    parser.add_argument("--json", type=pathlib.Path, metavar="F", help="write all reports to F")
    parser.add_argument("--out", type=pathlib.Path, help="keep the results in this folder")
    args = parser.parse_args()
    if not args.program.exists():
        parser.error(f"{args.program} is missing, build it first or name it with --program")
    return args


def find_mesh(pair, name):
    """The file of A or B of a pair; None if there is none."""
    files = (pair / (name + ending) for ending in (".obj", ".off", ".ply"))
    return next((f for f in files if f.exists()), None)


def find_pairs(args):
    pairs = sorted(p for p in args.meshes.glob("*") if find_mesh(p, "A") and find_mesh(p, "B"))
    if args.only:
        unknown = set(args.only) - {p.name for p in pairs}
        if unknown:
            sys.exit(f"table.py: no pair {', '.join(sorted(unknown))} in {args.meshes}")
        pairs = [p for p in pairs if p.name in args.only]
    if not pairs:
        sys.exit(f"table.py: no pairs in {args.meshes}")
    return pairs


def read_obj(path):
    """Vertices and faces."""
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            faces.append([int(w.split("/")[0]) - 1 for w in words[1:]])
    return vertices, faces


def moved(file, seed, to):
    """Writes an OBJ file with moved vertices, by which runs tell how much chance decides."""
    rng = random.Random(seed)
    with open(to, "w") as out:
        for line in file.read_text().splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                at = [repr(float(w) * (1 + 1e-9 * rng.uniform(-0.5, 0.5))) for w in words[1:4]]
                line = " ".join(["v"] + at)
            out.write(line + "\n")
    return to


def area_of(vertices, faces):
    """Of polygons, as fans."""
    total = 0
    for face in faces:
        for v, w in zip(face[1:], face[2:]):
            p, q = ([a - b for a, b in zip(vertices[i], vertices[face[0]])] for i in (v, w))
            total += 0.5 * math.hypot(p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                                      p[0] * q[1] - p[1] * q[0])
    return total


def registration_error(pair, folder):
    """Of the vertices of A that have an image, against gt.txt; None if there is none."""
    if not (pair / "gt.txt").exists():
        return None
    vertices, faces = read_obj(pair / "B.obj")
    images, covered = read_obj(folder / "A_on_B.obj")
    has_image = {v for face in covered for v in face}
    belongs = (map(int, line.split()) for line in (pair / "gt.txt").read_text().splitlines())
    errors = [math.dist(images[a], vertices[b]) for a, b in belongs if a in has_image]
    return 100 * sum(errors) / len(errors) / math.sqrt(area_of(vertices, faces))


def farthest_landmarks(pair, k, file):
    """Writes k lines of landmarks.txt: the two farthest apart, then always the farthest one."""
    vertices, _ = read_obj(find_mesh(pair, "A"))
    lines = [line for line in (pair / "landmarks.txt").read_text().splitlines()
             if line.strip() and not line.startswith("#")]
    point = [vertices[int(line.split()[0])] for line in lines]
    chosen = list(max(((i, j) for i in range(len(lines)) for j in range(i)),
                      key=lambda ij: math.dist(point[ij[0]], point[ij[1]])))
    while len(chosen) < min(k, len(lines)):
        chosen.append(max(range(len(lines)),
                          key=lambda i: min(math.dist(point[i], point[j]) for j in chosen)))
    file.write_text("\n".join(lines[i] for i in chosen) + "\n")
    return file


def run(pair, folder, args):
    """The report of one run; {"error": sentence} if there is none."""
    folder.mkdir(parents=True, exist_ok=True)
    a, b = find_mesh(pair, "A"), find_mesh(pair, "B")
    if args.move is not None:
        a, b = (moved(m, args.move, folder / f"moved_{m.name}") for m in (a, b))
    command = [args.program.resolve(), a, b, "-o", folder, "--quiet"]
    if (pair / "landmarks.txt").exists() and not args.no_landmarks:
        command += ["--landmarks", pair / "landmarks.txt" if args.farthest is None else
                    farthest_landmarks(pair, args.farthest, folder / "landmarks.txt")]
    command += shlex.split(args.extra)
    with open(folder / "stderr.txt", "w+") as said:
        process = subprocess.Popen([str(c) for c in command], stdout=subprocess.DEVNULL,
                                   stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        said.seek(0)
        words = said.read().strip().splitlines() or ["no message"]
    code = os.waitstatus_to_exitcode(status)
    process.returncode = code
    if code != 0:
        return {"error": f"exit code {code}: {words[-1]}"}
    report = json.loads((folder / "report.json").read_text())
    report["peak_memory"] = 1024 * usage.ru_maxrss
    report["error_to_gt"] = registration_error(pair, folder)
    return report


def number(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"  # JSON null: not finite


def coverage_reward(options):
    """κ, see Options::coverage_weight; an isometry costs 2 under sd, 0 under the others."""
    return max(0, options["coverage_weight"] + (2 if options["measure"] == "sd" else 0))


def to_one_percent(report):
    """Iterations until E + κ (area A + area B) is within 1% of its last value; the areas are 1."""
    if report["options"]["keep_scale"]:
        return "-"
    energies = [it["energy"] + 2 * coverage_reward(report["options"])
                for it in report["iterations"]]
    return str(next(i for i, e in enumerate(energies) if e <= 1.01 * energies[-1]))


def done_to(mesh):
    """What was done to a mesh before it was mapped."""
    done = list(mesh["prepared"])
    if mesh["opened_at"] >= 0:
        done.append(f'opened at vertex {mesh["opened_at"]}')
    return "; ".join(done)


def row(name, report):
    if "error" in report:
        return [name, "", "", "", report["error"]] + [""] * (len(COLUMNS) - 5)
    start, final, seconds = report["start"], report["final"], report["seconds"]
    is_default = report["options"]["measure"] == "sd"
    distortion = final["symmetric_dirichlet"]["mean"] if is_default else final["mean_distortion"]
    added = " / ".join(str(len(report[mesh]["added"])) for mesh in "ab")
    phases = ["derivatives", "assembly", "solve", "search", "total"]
    coarse = seconds["optimization"] - sum(seconds[p] for p in phases[:4])
    return [name, f'{report["a"]["triangles"]} / {report["b"]["triangles"]}',
            str(final["iterations"]), to_one_percent(report), report["status"],
            number(distortion, 4),
            number(final["coverage_a"], 4), number(final["coverage_b"], 4),
            number(start["landmark_distance"], 4), number(final["landmark_distance"], 4),
            added, " + ".join(str(level["iteration"]) for level in report["coarse"]),
            number(seconds["embedding"], 1), number(coarse, 1)] + \
        [number(seconds[p], 1) for p in phases] + \
        [number(report["peak_memory"] / 1e6, 0), number(report["error_to_gt"], 2)] + \
        [done_to(report[mesh]) for mesh in "ab"]


def print_row(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    args = read_arguments()
    pairs = find_pairs(args)
    reports = {}
    with tempfile.TemporaryDirectory() as scratch, \
            concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        out = args.out or pathlib.Path(scratch)
        runs = [pool.submit(run, pair, out / pair.name, args) for pair in pairs]
        print_row(COLUMNS)
        print_row(["---"] + ["---:"] * 3 + ["---"] + ["---:"] * (len(COLUMNS) - 5))
        for pair, running in zip(pairs, runs):
            reports[pair.name] = running.result()
            print_row(row(pair.name, reports[pair.name]))
    if args.json:
        args.json.write_text(json.dumps(reports, indent=1) + "\n")
    return 1 if any("error" in r for r in reports.values()) else 0


if __name__ == "__main__":
    sys.exit(main())

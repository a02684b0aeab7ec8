#!/usr/bin/env python3
"""Coarse, CAD and long shapes, made by formulas: what ism_map ends at.

  coarse.py shapes PROGRAM          a table of cubes, cylinders, tubes and a cone, on finer meshes of the same
  coarse.py solids PROGRAM          the platonic solids onto each other and onto a sphere: mean distortion
  coarse.py curve PROGRAM OUT.svg [A B LANDMARKS]
                                    distortion against added triangles: all edges halved, and Options::refine

Distortion: 2 is an isometry. --jobs N: runs at once. --only WORD: rows with this word.
"""

import argparse
import concurrent.futures
import json
import math
import pathlib
import subprocess
import tempfile

LIMIT = 600  # seconds of a run


# ---- shapes: lists of vertices and of triangles ----

def oriented(vertices, triangles):
    """A convex solid around the origin, its triangles turned outwards."""
    def volume(t):
        (a, b, c), (d, e, f), (g, h, i) = (vertices[v] for v in t)
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return vertices, [t if volume(t) > 0 else (t[0], t[2], t[1]) for t in triangles]


def solid(vertices, faces):
    """The convex hull of vertices that lie on planes with `faces` corners each."""
    triangles = set()
    n = len(vertices)
    seen = set()
    for i in range(n):
        for j in range(i):
            for k in range(j):
                a, b, c = vertices[i], vertices[j], vertices[k]
                u, w = [b[x] - a[x] for x in range(3)], [c[x] - a[x] for x in range(3)]
                m = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]]
                above = [sum(m[x] * (p[x] - a[x]) for x in range(3)) for p in vertices]
                if max(above) > 1e-9 and min(above) < -1e-9:
                    continue
                on = tuple(v for v in range(n) if abs(above[v]) <= 1e-9)
                if len(on) != faces or on in seen:
                    continue
                seen.add(on)
                middle = [sum(vertices[v][x] for v in on) / faces for x in range(3)]
                e1 = [vertices[on[0]][x] - middle[x] for x in range(3)]
                e2 = [m[1] * e1[2] - m[2] * e1[1], m[2] * e1[0] - m[0] * e1[2], m[0] * e1[1] - m[1] * e1[0]]
                size = math.hypot(*m)
                ring = sorted(on, key=lambda v: math.atan2(
                    sum(e2[x] * (vertices[v][x] - middle[x]) for x in range(3)) / size,
                    sum(e1[x] * (vertices[v][x] - middle[x]) for x in range(3))))
                triangles.update((ring[0], ring[x], ring[x + 1]) for x in range(1, faces - 1))
    return oriented(vertices, sorted(triangles))


def platonic():
    phi = (1 + math.sqrt(5)) / 2
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    cyclic = lambda p: [(p[0], p[1], p[2]), (p[1], p[2], p[0]), (p[2], p[0], p[1])]
    pairs = [(x, y) for x in (-1, 1) for y in (-1, 1)]
    return {
        "tetrahedron": solid([p for p in signs if p[0] * p[1] * p[2] > 0], 3),
        "cube": solid(signs, 4),
        "octahedron": solid([p for s in (-1, 1) for p in cyclic((s, 0, 0))], 3),
        "dodecahedron": solid(signs + [p for x, y in pairs for p in cyclic((0, x / phi, y * phi))], 5),
        "icosahedron": solid([p for x, y in pairs for p in cyclic((0, x, y * phi))], 3),
    }


def halved(mesh):
    """Each triangle in four."""
    vertices, triangles = list(mesh[0]), []
    middle = {}

    def between(u, v):
        key = (min(u, v), max(u, v))
        if key not in middle:
            middle[key] = len(vertices)
            vertices.append(tuple((a + b) / 2 for a, b in zip(vertices[u], vertices[v])))
        return middle[key]
    for a, b, c in mesh[1]:
        d, e, f = between(a, b), between(b, c), between(c, a)
        triangles += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
    return vertices, triangles


def sphere(times):
    mesh = platonic()["icosahedron"]
    for _ in range(times):
        mesh = halved(mesh)
        mesh = ([tuple(x / math.hypot(*p) for x in p) for p in mesh[0]], mesh[1])
    return mesh


def revolved(profile, sides, bend=0):
    """A surface of revolution; (radius, height) from bottom to top, radius 0 at a pole. Bent by an angle."""
    vertices, rings = [], []
    top = profile[-1][1]

    def place(r, z, a):
        x, y = r * math.cos(a), r * math.sin(a)
        if bend == 0:
            return x, y, z
        radius = top / bend
        return (radius - (radius - x) * math.cos(z / radius), y, (radius - x) * math.sin(z / radius))
    for r, z in profile:
        n = 1 if r == 0 else sides
        rings.append(range(len(vertices), len(vertices) + n))
        vertices += [place(r, z, 2 * math.pi * k / sides) for k in range(n)]
    triangles = []
    for low, high in zip(rings, rings[1:]):
        for k in range(sides):
            a, b = low[k % len(low)], low[(k + 1) % len(low)]
            c, d = high[k % len(high)], high[(k + 1) % len(high)]
            if a != b:
                triangles.append((a, b, d))
            if c != d:
                triangles.append((a, d, c))
    return vertices, triangles


def cylinder(sides, length, rings=1, cap=1):
    """Closed, of radius 1."""
    bottom = [(k / cap, 0) for k in range(cap)]
    return revolved(bottom + [(1, length * k / rings) for k in range(rings + 1)] + [(r, length) for r, _ in bottom[::-1]],
                    sides)


def tube(sides, length, rings, bend=0):
    """Open at both ends, of radius 1."""
    return revolved([(1, length * k / rings) for k in range(rings + 1)], sides, bend)


def coil(sides, length, rings, radius=15, pitch=5):
    """An open tube of radius 1 along a helix."""
    per_turn = math.hypot(radius, pitch)
    vertices = []
    for i in range(rings + 1):
        t = length * i / rings / per_turn
        c, s = math.cos(t), math.sin(t)
        for k in range(sides):
            u, v = math.cos(2 * math.pi * k / sides), math.sin(2 * math.pi * k / sides)
            b = pitch / per_turn * v
            vertices.append(((radius - u) * c + b * s, (radius - u) * s - b * c, pitch * t + radius / per_turn * v))
    return vertices, tube(sides, length, rings)[1]


def cone(sides, height, rings=1):
    return revolved([(1 - k / rings, height * k / rings) for k in range(rings + 1)], sides)


def disk(sides, rings):
    return revolved([(1 - k / rings, 0) for k in range(rings + 1)], sides)


# ---- runs ----

def write(mesh, path):
    path.write_text("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh[0]) +
                    "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh[1]))
    return path


def run(program, a, b, *options):
    """The report of ism_map, or what went wrong."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        files = [write(m, folder / f"{s}.obj") if isinstance(m, tuple) else m for s, m in (("A", a), ("B", b))]
        try:
            done = subprocess.run([program, *files, "-o", folder / "out", *options], capture_output=True, text=True,
                                  timeout=LIMIT)
        except subprocess.TimeoutExpired:
            return {"failure": f"none in {LIMIT} s"}
        report = folder / "out/report.json"
        if not report.exists():
            return {"failure": done.stderr.strip().splitlines()[-1]}
        return json.loads(report.read_text())


def shapes():
    fine = cylinder(48, 4, 32, 8)
    pairs = {"cube, onto a sphere": (platonic()["cube"], sphere(4)),
             "cylinder of 128 sides, onto a finer one": (cylinder(128, 2), cylinder(128, 2, 40, 1)),
             "cylinder of 128 sides, onto itself": (cylinder(128, 2), cylinder(128, 2))}
    for sides in (12, 24, 48):
        pairs[f"cylinder of {sides} sides, 20 times as long as wide"] = (cylinder(sides, 40),
                                                                        cylinder(24, 40, 150, 4))
        pairs[f"cylinder of {sides} sides, twice as long as wide"] = (cylinder(sides, 4), fine)
    for length in (20, 60, 100, 200):
        pairs[f"tube {length} times as long as wide"] = (tube(8, 2 * length, length), tube(7, 2 * length, length, 1))
    pairs["tube 200 times as long as wide, 24,000 triangles"] = (tube(16, 400, 750), tube(14, 400, 857, 1))
    pairs["tube 100 times as long as wide, onto a coil"] = (tube(8, 200, 100), coil(9, 200, 110))
    pairs["tube 60 times as long as wide, onto a closed one"] = (tube(8, 120, 60), cylinder(24, 120, 120, 2))
    pairs["cone of 512 triangles, onto a disk"] = (cone(512, 1), disk(64, 20))
    return pairs


def table_of_shapes(options):
    print("| pair | triangles | added | distortion | coverage | seconds |")
    print("|---|---:|---:|---:|---:|---:|")

    def row(item):
        name, (a, b) = item
        r = run(options.program, a, b, *options.extra)
        sizes = f"{len(a[1]):,}, {len(b[1]):,}"
        if "final" not in r:
            return f"| {name} | {sizes} | | {r.get('failure', r.get('message'))} | | |"
        f = r["final"]
        added = ", ".join(str(len(r[s].get("added", []))) for s in "ab")
        return (f"| {name} | {sizes} | {added} | {f['mean_distortion']:#.{4 if f['mean_distortion'] < 1e3 else 2}g} | "
                f"{f['coverage_a']:.1%}, {f['coverage_b']:.1%} | "
                f"{r['seconds']['total']:.1f} |")
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for line in pool.map(row, [i for i in shapes().items() if options.only in i[0]]):
            print(line, flush=True)


def table_of_solids(options):
    solids = platonic()
    targets = {**solids, "sphere": sphere(4)}
    print("| onto |", " | ".join(targets), "|")
    print("|---|" + "---:|" * len(targets))
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for name, a in solids.items():
            results = pool.map(lambda b: run(options.program, a, b, *options.extra), targets.values())
            cells = [f"{r['final']['mean_distortion']:.3f}, {r['seconds']['total']:.0f} s" if "final" in r
                     else r.get("failure", r.get("message")) for r in results]
            print(f"| {name} |", " | ".join(cells), "|", flush=True)


# ---- the curve ----

def read(path):
    vertices, triangles = [], []
    for line in pathlib.Path(path).read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append(tuple(float(w) for w in words[1:4]))
        elif words[:1] == ["f"]:
            triangles.append(tuple(int(w.split("/")[0]) - 1 for w in words[1:4]))
    return vertices, triangles


def curve_of(program, a, b, landmarks):
    """(triangles, distortion) with all edges of A halved, also of B if it is as coarse, and by refine."""
    extra = ["--landmarks", landmarks] if landmarks else []
    uniform, adaptive = [], []
    mesh = a, b
    for _ in range(4):
        r = run(program, *mesh, "--refine", "0", *extra)
        if "final" not in r:
            break
        uniform.append((len(mesh[0][1]) + len(mesh[1][1]), r["final"]["mean_distortion"]))
        both = len(b[1]) < 2 * len(a[1])
        mesh = halved(mesh[0]), halved(mesh[1]) if both else mesh[1]
        if len(mesh[0][1]) > 20000:
            break
    for refine in ("16", "8", "4", "2", "1"):
        r = run(program, a, b, "--refine", refine, *extra)
        if "final" not in r:
            continue
        n = len(a[1]) + len(b[1]) + sum(2 * len(r[s].get("added", [])) for s in "ab")
        adaptive.append((n, r["final"]["mean_distortion"]))
    return uniform, adaptive


def drawn(curves):
    """An SVG picture; a panel per pair."""
    width, height, margin = 300, 220, 44
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width * len(curves)}" height="{height + 30}" '
           'font-family="sans-serif" font-size="11">', '<rect width="100%" height="100%" fill="white"/>']
    for i, (name, series) in enumerate(curves.items()):
        points = [p for s in series for p in s]
        lo, hi = min(p[0] for p in points), max(p[0] for p in points)
        low, high = min(p[1] for p in points), max(p[1] for p in points)
        pad = 0.08 * (high - low or 1)
        low, high = low - pad, high + pad

        def place(p):
            span = math.log(hi / lo) or 1
            return (i * width + margin + (width - margin - 16) * math.log(p[0] / lo) / span,
                    30 + (height - 60) * (high - p[1]) / (high - low))
        left, bottom = i * width + margin, 30 + height - 60
        out.append(f'<text x="{left}" y="16" font-weight="bold">{name}</text>')
        out.append(f'<path d="M{left} 30V{bottom}H{(i + 1) * width - 12}" fill="none" stroke="#888"/>')
        for value in (low + pad, high - pad):
            y = place((lo, value))[1]
            out.append(f'<text x="{left - 4}" y="{y + 4:.1f}" text-anchor="end">{value:.2f}</text>')
        for value, anchor in ((lo, "start"), (hi, "end")):
            x = place((value, low))[0]
            out.append(f'<text x="{x:.1f}" y="{bottom + 14}" text-anchor="{anchor}">{value:,}</text>')
        for points, color in zip(series, ("#c03020", "#2060c0")):
            at = [place(p) for p in sorted(points)]
            out.append(f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in at)}" fill="none" '
                       f'stroke="{color}" stroke-width="1.5"/>')
            out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{color}"/>' for x, y in at]
    out.append(f'<text x="{margin}" y="{height + 18}"><tspan fill="#c03020">all edges halved</tspan>, '
               '<tspan fill="#2060c0">Options::refine = 16, 8, 4, 2, 1</tspan>; mean distortion over triangles of '
               'both meshes (logarithmic)</text></svg>')
    return "\n".join(out) + "\n"


def curve(options):
    pairs = {"cube onto a sphere": (platonic()["cube"], sphere(4), None),
             "cylinder of 24 sides": (cylinder(24, 4), cylinder(48, 4, 32, 8), None)}
    if options.pair:
        a, b, landmarks = options.pair
        pairs[pathlib.Path(a).parent.name] = (read(a), read(b), landmarks)
    curves = {name: curve_of(options.program, *pair) for name, pair in pairs.items()}
    for name, (uniform, adaptive) in curves.items():
        print(name, "\n  halved", uniform, "\n  refine", adaptive)
    pathlib.Path(options.out).write_text(drawn(curves))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["shapes", "solids", "curve"])
    parser.add_argument("program")
    parser.add_argument("out", nargs="?")
    parser.add_argument("pair", nargs="*")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="")
    options, extra = parser.parse_known_args()
    options.extra = extra
    {"shapes": table_of_shapes, "solids": table_of_solids, "curve": curve}[options.what](options)


if __name__ == "__main__":
    main()

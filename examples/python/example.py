"""Maps one hand onto the other, carries a pattern over, and shows the distortion.

    python3 examples/python/example.py [--data FOLDER] [--save PICTURE.png]

A folder has A.obj, B.obj and landmarks.txt. Each cell, between lines of # %%, can be run by itself
in an editor that knows them.
"""

# %% Read the meshes: vertices (#V, 3), triangles (#F, 3), pairs of vertices that correspond
import argparse
import pathlib

import ism
import numpy as np

DATA = pathlib.Path(__file__).resolve().parents[2] / "data" / "hand"
parser = argparse.ArgumentParser(description="Maps one mesh of a folder onto the other.")
parser.add_argument("--data", type=pathlib.Path, default=DATA, help="has A.obj, B.obj")
parser.add_argument("--save", default="map.png", help="the picture")
arguments = parser.parse_args()


def read_obj(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = [[float(x) for x in row[1:4]] for row in rows if row[:1] == ["v"]]
    faces = [[int(x.split("/")[0]) - 1 for x in row[1:4]] for row in rows if row[:1] == ["f"]]
    return np.array(vertices), np.array(faces)


a = read_obj(arguments.data / "A.obj")
b = read_obj(arguments.data / "B.obj")
landmarks = np.loadtxt(arguments.data / "landmarks.txt", dtype=int, usecols=(0, 1))

# %% Map; Ctrl-C stops with the best map so far
m = ism.map(a, b, landmarks, progress=True)
print(m)
for v in landmarks[:, 0]:
    image = m.a_to_b(v)
    position, triangle = image.positions[0].round(4), image.faces[0]
    print(f"vertex {v} of A goes to {position} in triangle {triangle} of B")

# %% Carry values: colors at the vertices of A, and what they are on B; gray where nothing is mapped
colors = 0.5 + 0.5 * np.sin(25 * a[0] / np.ptp(a[0], axis=0).max())
on_b = m.a_to_b.transfer(colors, fill=0.7)

# %% The distortion of each triangle of B: the mean over its polygons of the meta mesh, by area
d = m.distortion
area = np.bincount(m.meta.face_b, d.polygons[:, 1], len(b[1]))
total = np.bincount(m.meta.face_b, d.polygons[:, 1] * d.polygons[:, 4], len(b[1]))
distortion = np.divide(total, area, out=np.full(len(area), np.nan), where=area > 0)

# %% A picture: A, B with the stripes of A, B with the distortion
import matplotlib  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # noqa: E402


def show(axes, mesh, colors, title):
    """Draws triangles with a color each, shaded by their normals."""
    corners = mesh[0][mesh[1]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = 0.55 + 0.45 * np.abs(normals @ [0.3, 0.2, 0.93])
    rgb = np.clip(colors[:, :3] * light[:, None], 0, 1)
    axes.add_collection3d(Poly3DCollection(corners, facecolors=rgb, edgecolors=rgb, linewidths=0.2))
    low, high = mesh[0].min(axis=0), mesh[0].max(axis=0)
    center, radius = (low + high) / 2, (high - low).max() / 2 * 0.65
    axes.set_xlim(center[0] - radius, center[0] + radius)
    axes.set_ylim(center[1] - radius, center[1] + radius)
    axes.set_zlim(center[2] - radius, center[2] + radius)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=90, azim=-90)
    axes.set_axis_off()
    axes.set_title(title)


figure, axes = plt.subplots(1, 3, figsize=(13, 5), subplot_kw={"projection": "3d"})
show(axes[0], a, colors[a[1]].mean(axis=1), "A")
show(axes[1], b, on_b[b[1]].mean(axis=1), "the colors of A on B")
relative = (distortion - 2) / (np.nanpercentile(distortion, 98) - 2)
heat = np.where(np.isnan(relative)[:, None], 0.7, plt.cm.viridis(relative))
show(axes[2], b, heat, f"distortion, {d.mean:.3f} in the mean")
figure.tight_layout()
figure.savefig(arguments.save, dpi=110)
print(f"saved {arguments.save}")

"""Values and displacements from the source to the target, by arrays only."""

from typing import Any

import numpy as np

from . import ism
from .surface import Surface, inverse_of

ROUNDS = 50  # of smoothing what was filled
NEAR = 4  # rounds of neighbours: a fold, as of a lip, turns nothing over


def to_vertices(map: ism.Map, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values at the vertices of the target, (v, k), and which of these are covered."""
    is_covered = np.diff(map.a_to_b.csr()[0]) > 0
    return map.a_to_b.transfer(values), is_covered


def to_loops(
    map: ism.Map, source: Surface, target: Surface, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The same for face corners: those of several triangles get the mean of these."""
    is_covered = np.diff(map.a_to_b.csr("corner", "corner")[0]) > 0
    rows = map.a_to_b.transfer(values[source.loops.ravel()], "corner", "corner")
    loops = target.loops.ravel()[is_covered]
    total = sums(loops, rows[is_covered], target.n_loops)
    count = np.bincount(loops, minlength=target.n_loops)
    return total / np.maximum(count, 1)[:, None], count > 0


def dropped(map: ism.Map, source: Surface, target: Surface) -> tuple[int, int]:
    """How many vertices of the source and of the target are in parts that were not mapped at all.

    Of several loose parts the library maps one: that with most landmarks, or the largest.
    """
    counts = []
    for direction, surface in ((map.a_to_b, source), (map.b_to_a, target)):
        nothing = np.zeros((len(surface.positions), 0))
        _, reached = spread(nothing, direction().covered, surface.triangles, rounds=0)
        counts.append(len(reached) - int(reached.sum()))
    return counts[0], counts[1]


def sums(rows: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Row i is the sum of the values, (m, k), whose rows are i."""
    result = np.empty((n, values.shape[1]))
    for k, column in enumerate(values.T):
        result[:, k] = np.bincount(rows, column, n)
    return result


def spread(
    values: np.ndarray, is_known: np.ndarray, triangles: np.ndarray, rounds: int = ROUNDS
) -> tuple[np.ndarray, np.ndarray]:
    """Fills values of vertices, (v, k), from their neighbours, smoothly.

    Returns:
        The values, and which are known now: not those of parts where none was known.
    """
    if is_known.all() or not is_known.any():
        return values, is_known
    i = np.concatenate([triangles, triangles[:, [1, 2, 0]]]).ravel()
    j = np.concatenate([triangles[:, [1, 2, 0]], triangles]).ravel()
    i, j = i[~is_known[i]], j[~is_known[i]]
    values, reached = np.where(is_known[:, None], values, 0.0), is_known.copy()

    def average(is_used: np.ndarray) -> np.ndarray:
        count = np.bincount(i[is_used], minlength=len(values))
        at = np.flatnonzero(count)
        values[at] = sums(i[is_used], values[j[is_used]], len(values))[at] / count[at, None]
        return at

    while True:
        at = average(reached[j] & ~reached[i])
        if not len(at):
            break
        reached[at] = True
    for _ in range(rounds):
        average(reached[j])
    return values, reached


def _signed_normals(
    positions: np.ndarray, triangles: np.ndarray, of: np.ndarray, polygons: np.ndarray
) -> np.ndarray:
    """Unit normals of triangles, on the side from which their polygons are counter-clockwise.

    The library turns triangles over, where these contradict their neighbours.

    Args:
        of: the triangle of each polygon.
        polygons: (p, 3), area vectors of the polygons.
    """
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    side = np.bincount(of, (normals[of] * polygons).sum(axis=1), len(triangles))
    return np.where(side < 0, -1.0, 1.0)[:, None] * normals


def gradients(map: ism.Map, source: Surface, target: Surface) -> tuple[np.ndarray, np.ndarray]:
    """How the map turns and stretches space at each vertex of the target.

    A polygon of the common refinement has a linear map of its plane; normals go to normals, longer
    by the root of the ratio of the areas. The mean over the triangles around a vertex is weighted by
    area. Integrals along the sides of the polygons take the place of derivatives, so that slivers
    do no harm.

    Returns:
        (v, 3, 3), and which vertices have one.
    """
    meta = map.meta
    polygon, following = sides(meta)
    corners = meta.corners
    first = corners[meta.offsets[:-1]]

    def on(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Both ends of each side, from the first corner of the polygon, and the area vectors."""
        origin = positions[first][polygon]
        p, q = positions[corners] - origin, positions[corners[following]] - origin
        return p, q, sums(polygon, np.cross(p, q), len(first)) / 2

    (p, q, vector_a), (r, s, vector_b) = on(meta.on_a), on(meta.on_b)
    normals_a = _signed_normals(source.positions, source.triangles, meta.face_a, vector_a)
    normals_b = _signed_normals(target.positions, target.triangles, meta.face_b, vector_b)
    normal_a, normal_b = normals_a[meta.face_a], normals_b[meta.face_b]
    outward = np.cross(q - p, normal_a[polygon])
    area_a, area_b = (
        np.abs((v * n).sum(axis=1)) for v, n in ((vector_a, normal_a), (vector_b, normal_b))
    )
    inside = np.einsum("ci,cj->cij", (r + s) / 2, outward).reshape(-1, 9)
    across = np.einsum("p,pi,pj->pij", np.sqrt(area_a * area_b), normal_b, normal_a).reshape(-1, 9)
    integral = sums(polygon, inside, len(first)) + across
    per_face = sums(meta.face_b, np.column_stack([integral, area_a]), len(target.triangles))
    n = len(target.positions)
    total = sums(target.triangles.ravel(), np.repeat(per_face, 3, axis=0), n)
    neighbours = np.roll(target.triangles, -1, axis=1)
    for _ in range(NEAR):
        total += sums(target.triangles.ravel(), total[neighbours.ravel()], n)
    has_area = total[:, 9] > 0
    mean = total[:, :9] / np.where(has_area, total[:, 9], 1)[:, None]
    return mean.reshape(-1, 3, 3), has_area


def sides(meta: Any) -> tuple[np.ndarray, np.ndarray]:
    """Per corner of the common refinement: its polygon, and the next corner of that."""
    polygon = np.repeat(np.arange(len(meta.face_a)), np.diff(meta.offsets))
    following = np.arange(1, len(polygon) + 1)
    following[meta.offsets[1:] - 1] = meta.offsets[:-1]
    return polygon, following


def to_shape(
    map: ism.Map, source: Surface, target: Surface, displacements: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements, (k, v, 3), in the space of the target from those in the space of the source.

    Returns:
        The displacements, 0 where there are none, and which vertices have one.
    """
    local, has_one = gradients(map, source, target)
    moves = source.matrix[:3, :3]
    back = inverse_of(target.matrix, target.name)[:3, :3]
    local = np.einsum("ij,vjk,kl->vil", back, local, moves)
    k, n = len(displacements), len(source.positions)
    rows, is_covered = to_vertices(map, displacements.transpose(1, 0, 2).reshape(n, 3 * k))
    carried = np.einsum("vij,vkj->vki", local, rows.reshape(-1, k, 3))
    known = is_covered & has_one
    carried = np.where(known[:, None, None], carried, 0.0).reshape(-1, 3 * k)
    carried, known = spread(carried, known, target.triangles)
    return carried.reshape(-1, k, 3).transpose(1, 0, 2), known


def wrapped(map: ism.Map, source: Surface, target: Surface) -> tuple[np.ndarray, int]:
    """Where the source's vertices lie on the target, in world space.

    Vertices without an image follow their neighbours: they differ from the best affine map of the
    source as these do.

    Returns:
        (v, 3), and how many have no image.
    """
    images = map.a_to_b()
    is_covered = images.covered
    corners = target.positions[target.triangles[images.faces[is_covered]]]
    positions = np.einsum("vk,vki->vi", images.barycentric[is_covered], corners)
    space = np.column_stack([source.positions, np.ones(len(source.positions))])
    affine = space @ np.linalg.lstsq(space[is_covered], positions, rcond=None)[0]
    difference = np.zeros_like(affine)
    difference[is_covered] = positions - affine[is_covered]
    filled, _ = spread(difference, is_covered, source.triangles)
    return affine + filled, int(len(affine) - is_covered.sum())

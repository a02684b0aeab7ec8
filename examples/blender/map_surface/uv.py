"""UV maps from the source to the target, along seams too.

A UV map lies on a surface in islands, between which it jumps. A face of the target that crosses a
seam would reach from one island to the next, over all that is between them in the image. So each
face gets one island, continued linearly beyond its border.
"""

import numpy as np

from . import ism
from .carry import sides, sums
from .surface import Surface

SAME = 1e-4  # of the image: closer coordinates are one place for Blender, too
AT_CORNER = 1 - 1e-9
EXACT = 1e6  # weight of values that are known, against those to which others only come close


def carry_uv(map: ism.Map, source: Surface, target: Surface, uv: np.ndarray) -> np.ndarray:
    """The UV map of the target's face corners, (l, 2), from that of the source's.

    What lies on a face falls apart where the coordinates jump: between islands, or where one island
    meets itself, as around a cylinder. The largest part is taken. Corners in it have its values
    there, so that faces beside each other fit; the others have those of the affine function closest
    to the part. Faces of which less than half is covered have NaN.
    """
    meta = map.meta
    polygon, following = sides(meta)
    n_faces = int(target.faces.max()) + 1
    face = target.faces[meta.face_b]
    at = np.einsum("ck,ckd->cd", meta.corner_a, uv[source.loops[meta.face_a[polygon]]])

    # How much of its face each polygon is, in units of area on the target.
    b0, b1 = meta.corner_b, meta.corner_b[following]
    areas = _areas(target)
    part_of_triangle = np.abs(
        np.bincount(polygon, b0[:, 0] * b1[:, 1] - b0[:, 1] * b1[:, 0], len(face))
    )
    share = part_of_triangle * areas[meta.face_b]
    label = _parts(meta.corners, following, polygon, face, at)
    chosen = _largest(label, share, face, n_faces)
    size = np.bincount(face[chosen], share[chosen], n_faces)
    total = np.bincount(target.faces, areas, n_faces)
    is_mapped = size > total - np.bincount(face, share, n_faces)
    chosen &= is_mapped[face]

    result = np.full((target.n_loops, 2), np.nan)
    k = b0.argmax(axis=1)
    exact = chosen[polygon] & (b0[np.arange(len(k)), k] >= AT_CORNER)
    result[target.loops[meta.face_b[polygon[exact]], k[exact]]] = at[exact]
    weight = (share / np.diff(meta.offsets))[polygon] * np.where(exact, EXACT, 1.0)
    _continue(result, target, meta, polygon, chosen, weight, at, is_mapped)
    return result


def _areas(surface: Surface) -> np.ndarray:
    return np.linalg.norm(_area_vectors(surface), axis=1)


def _area_vectors(surface: Surface) -> np.ndarray:
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def _parts(
    corners: np.ndarray,
    following: np.ndarray,
    polygon: np.ndarray,
    face: np.ndarray,
    at: np.ndarray,
) -> np.ndarray:
    """Per polygon, one that stands for all of its face to which the coordinates go on."""
    v, w = corners, corners[following]
    is_turned = v > w
    low, high = np.minimum(v, w), np.maximum(v, w)
    at_low = np.where(is_turned[:, None], at[following], at)
    at_high = np.where(is_turned[:, None], at, at[following])
    order = np.lexsort((polygon, high, low, face[polygon]))
    d, e = order[:-1], order[1:]
    is_one = (low[d] == low[e]) & (high[d] == high[e]) & (face[polygon[d]] == face[polygon[e]])
    for values in (at_low, at_high):
        is_one &= np.abs(values[d] - values[e]).max(axis=1) <= SAME
    i, j = polygon[d[is_one]], polygon[e[is_one]]
    label = np.arange(len(face))
    while True:
        least = np.minimum(label[i], label[j])
        before = label.copy()
        np.minimum.at(label, i, least)
        np.minimum.at(label, j, least)
        label = label[label]
        if (label == before).all():
            return label


def _largest(label: np.ndarray, share: np.ndarray, face: np.ndarray, n_faces: int) -> np.ndarray:
    """Which polygons are in the largest part of their face."""
    size = np.bincount(label, share, len(label))
    order = np.lexsort((-label, size[label], face))
    best = np.full(n_faces, -1)
    best[face[order]] = label[order]  # the last of a face wins
    return label == best[face]


def _continue(
    result: np.ndarray,
    target: Surface,
    meta: ism.Meta,
    polygon: np.ndarray,
    chosen: np.ndarray,
    weight: np.ndarray,
    at: np.ndarray,
    is_mapped: np.ndarray,
) -> None:
    """Gives corners outside of the chosen parts the values of the closest affine functions.

    Args:
        weight, at: per corner of the refinement, its weight and its coordinates.
    """
    loops, at_loop = np.unique(target.loops, return_index=True)  # n-gons have some several times
    face_of = np.repeat(target.faces, 3)[at_loop]
    vertex = target.triangles.ravel()[at_loop]
    missing = is_mapped[face_of] & np.isnan(result[loops, 0])
    faces = np.unique(face_of[missing])
    if not len(faces):
        return
    row = np.full(len(is_mapped), -1)
    row[faces] = np.arange(len(faces))

    # Coordinates in the plane of each face, of about 1.
    triangle_rows = row[target.faces]
    used = triangle_rows >= 0
    vectors = sums(triangle_rows[used], _area_vectors(target)[used], len(faces))
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    normal = vectors / np.maximum(length, 1e-300)
    x_axis = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    x_axis /= np.maximum(np.linalg.norm(x_axis, axis=1, keepdims=True), 1e-300)
    frame = np.stack([x_axis, np.cross(normal, x_axis)], axis=1)
    frame /= np.sqrt(np.maximum(length, 1e-300))[:, None]
    origin = np.zeros((len(faces), 3))
    origin[row[face_of[missing]]] = target.positions[vertex[missing]]

    def places(rows: np.ndarray, positions: np.ndarray) -> np.ndarray:
        plane = np.einsum("nij,nj->ni", frame[rows], positions - origin[rows])
        return np.column_stack([plane, np.ones(len(rows))])

    c = np.flatnonzero(chosen[polygon] & (row[target.faces[meta.face_b[polygon]]] >= 0))
    triangle = meta.face_b[polygon[c]]
    rows = row[target.faces[triangle]]
    corners = target.positions[target.triangles[triangle]]
    points = places(rows, np.einsum("ck,cki->ci", meta.corner_b[c], corners))
    normal_matrix = sums(rows, _outer(points, points, weight[c]), len(faces)).reshape(-1, 3, 3)
    right = sums(rows, _outer(points, at[c], weight[c]), len(faces)).reshape(-1, 3, 2)
    affine = np.linalg.pinv(normal_matrix, rcond=1e-12, hermitian=True) @ right
    rows = row[face_of[missing]]
    points = places(rows, target.positions[vertex[missing]])
    result[loops[missing]] = np.einsum("ni,nij->nj", points, affine[rows])


def _outer(p: np.ndarray, q: np.ndarray, weight: np.ndarray) -> np.ndarray:
    return np.einsum("n,ni,nj->nij", weight, p, q).reshape(len(p), -1)


def seams_of(
    uv: np.ndarray, loop_vertices: np.ndarray, loop_edges: np.ndarray, next_loops: np.ndarray
) -> np.ndarray:
    """The edges where the coordinates, (l, 2), of two faces differ.

    Args:
        loop_vertices, loop_edges, next_loops: per face corner, its vertex, the edge to the next
            corner of the face, and that.
    """
    is_turned = (loop_vertices > loop_vertices[next_loops])[:, None]
    ends = np.column_stack(
        [np.where(is_turned, uv[next_loops], uv), np.where(is_turned, uv, uv[next_loops])]
    )
    order = np.argsort(loop_edges, kind="stable")
    d, e = order[:-1], order[1:]
    is_seam = (loop_edges[d] == loop_edges[e]) & (np.abs(ends[d] - ends[e]).max(axis=1) > SAME)
    return np.unique(loop_edges[d[is_seam]])

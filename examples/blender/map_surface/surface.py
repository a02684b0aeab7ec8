"""Objects of Blender as surfaces: triangles in world space, and where they come from."""

import contextlib
import hashlib
from typing import Any, Iterator, NamedTuple, Optional

import bpy
import numpy as np


class UserError(Exception):
    """A sentence for the user."""


class Surface(NamedTuple):
    """The mesh of an object, in world space.

    Attributes:
        name: of the object.
        positions: (v, 3) float64.
        triangles: (t, 3) int32, counter-clockwise from outside, also of mirrored objects.
        loops: (t, 3) int32, the face corners of Blender at these corners.
        faces: (t,) int32, the faces of Blender.
        matrix: (4, 4), from the object's space to that of the positions.
        n_loops: the number of face corners.
        topology: a digest of the faces; equal ones have the same ids.
    """

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    loops: np.ndarray
    faces: np.ndarray
    matrix: np.ndarray
    n_loops: int
    topology: bytes


MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def numbers(items: Any, name: str, columns: int, kind: type) -> np.ndarray:
    """An attribute of all items, one row for each."""
    array = np.empty(len(items) * columns, kind)
    items.foreach_get(name, array)
    return array.reshape(-1, columns) if columns > 1 else array


@contextlib.contextmanager
def mesh_of(object: bpy.types.Object, is_evaluated: bool) -> Iterator[bpy.types.Mesh]:
    """The mesh as in edit mode, or with the modifiers and shape keys as shown."""
    if object.mode == "EDIT":
        object.update_from_editmode()
    if not is_evaluated:
        yield object.data
        return
    graph = bpy.context.evaluated_depsgraph_get()
    evaluated = object.evaluated_get(graph)
    try:
        yield evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=graph)
    finally:
        evaluated.to_mesh_clear()


def positions_of(mesh: bpy.types.Mesh, is_evaluated: bool) -> np.ndarray:
    """The vertices in the object's space, (v, 3); those of the basis, if there are shape keys."""
    has_basis = mesh.shape_keys and not is_evaluated
    items = mesh.shape_keys.reference_key.data if has_basis else mesh.vertices
    return numbers(items, "co", 3, np.float32).astype(float)


def matrix_of(object: bpy.types.Object, is_reflected: bool) -> np.ndarray:
    """From the object's space, or its mirror image along X, to the world."""
    matrix = np.array(object.matrix_world)
    return matrix @ MIRROR if is_reflected else matrix


def moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def inverse_of(matrix: np.ndarray, name: str) -> np.ndarray:
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        raise UserError(f"{name} has a scale of zero") from None


def topology_of(mesh: bpy.types.Mesh) -> bytes:
    digest = hashlib.blake2b(len(mesh.vertices).to_bytes(8, "little"), digest_size=16)
    digest.update(numbers(mesh.polygons, "loop_total", 1, np.int32))
    digest.update(numbers(mesh.loops, "vertex_index", 1, np.int32))
    return digest.digest()


def read_surface(
    object: bpy.types.Object, is_evaluated: bool, is_reflected: bool = False
) -> Surface:
    """Reads an object of the scene.

    Raises:
        UserError: it has no faces.
    """
    with mesh_of(object, is_evaluated) as mesh:
        if not mesh.polygons:
            raise UserError(f"{object.name} has no faces")
        mesh.calc_loop_triangles()
        items = mesh.loop_triangles
        triangles = numbers(items, "vertices", 3, np.int32)
        loops = numbers(items, "loops", 3, np.int32)
        faces = numbers(items, "polygon_index", 1, np.int32)
        matrix = matrix_of(object, is_reflected)
        if np.linalg.det(matrix[:3, :3]) < 0:  # else the surface would be inside out
            triangles, loops = triangles[:, ::-1].copy(), loops[:, ::-1].copy()
        positions = moved(matrix, positions_of(mesh, is_evaluated))
        n_loops, topology = len(mesh.loops), topology_of(mesh)
    return Surface(object.name, positions, triangles, loops, faces, matrix, n_loops, topology)


def object_in(
    scene: bpy.types.Scene, object: Optional[bpy.types.Object], role: str
) -> bpy.types.Object:
    """The object, if the scene has it.

    Raises:
        UserError: it is missing, e.g. deleted, which leaves it in the settings.
    """
    if object is None:
        raise UserError(f"Choose the {role} object")
    if object.name not in scene.objects:
        raise UserError(f"{object.name}, the {role}, is not in this scene any more")
    return object

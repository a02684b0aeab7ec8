"""Landmarks: pairs of empties, each of which stands for the nearest point of its surface."""

from typing import Any

import bmesh
import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from .surface import Surface, UserError, inverse_of, matrix_of, moved

AT_VERTEX = 1e-4  # barycentric distance at which a point is the vertex itself
COLLECTION = "Map Surface Landmarks"


class _Finder:
    def __init__(self, surface: Surface):
        self.surface = surface
        self.tree = BVHTree.FromPolygons(surface.positions.tolist(), surface.triangles.tolist())

    def __call__(self, place: np.ndarray) -> Any:
        """The vertex or the point (triangle, barycentric coordinates) nearest to a place."""
        nearest, _, triangle, _ = self.tree.find_nearest(place.tolist())
        if nearest is None:
            raise UserError(f"{self.surface.name} has no point near a landmark")
        vertices = self.surface.triangles[triangle]
        corners = self.surface.positions[vertices]
        system = np.vstack([corners.T, np.full(3, np.abs(corners).max() + 1)])
        right = np.append(nearest, system[3, 0])
        point = np.clip(np.linalg.lstsq(system, right, rcond=None)[0], 0, None)
        point /= point.sum()
        k = int(point.argmax())
        return int(vertices[k]) if point[k] > 1 - AT_VERTEX else (triangle, tuple(point))


def pairs_of(settings: Any, source: Surface, target: Surface) -> tuple[list, list[str]]:
    """The landmarks as the library takes them, and sentences on those that are left out."""
    pairs, sentences = [], []
    to_source = np.eye(4)
    if settings.use_mirror:
        to_source = source.matrix @ inverse_of(matrix_of(settings.source, False), source.name)
    on_source = on_target = None
    for item in settings.landmarks:
        missing = [
            role
            for role, empty in (("source", item.source), ("target", item.target))
            if empty is None or empty.name not in bpy.context.scene.objects
        ]
        if missing:
            what = " and no ".join(missing)
            sentences.append(f"Landmark {item.name} has no {what} any more: it is left out")
            continue
        on_source = on_source or _Finder(source)
        on_target = on_target or _Finder(target)
        place = np.array(item.source.matrix_world.translation)
        pairs.append(
            (
                on_source(moved(to_source, place)),
                on_target(np.array(item.target.matrix_world.translation)),
            )
        )
    return pairs, sentences


def selected_places(object: bpy.types.Object) -> list:
    """The selected vertices of an object, in world space, in the order of the clicks."""
    if object.mode != "EDIT":
        chosen = [v for v in object.data.vertices if v.select]
        has_order = False
    else:
        mesh = bmesh.from_edit_mesh(object.data)
        chosen = [v for v in mesh.verts if v.select]
        history = [v for v in mesh.select_history if isinstance(v, bmesh.types.BMVert)]
        has_order = len(history) == len(chosen)
        chosen = history if has_order else chosen
    if len(chosen) > 1 and not has_order:
        raise UserError(
            f"Select one vertex of {object.name}; or several, in edit mode, one click after another"
        )
    return [object.matrix_world @ v.co for v in chosen]


def _empty(
    name: str, place: Any, object: bpy.types.Object, scene: bpy.types.Scene
) -> bpy.types.Object:
    collection = bpy.data.collections.get(COLLECTION) or bpy.data.collections.new(COLLECTION)
    if COLLECTION not in scene.collection.children:
        scene.collection.children.link(collection)
    empty = bpy.data.objects.new(name, None)
    collection.objects.link(empty)
    empty.empty_display_type = "SPHERE"
    empty.empty_display_size = 0.02 * max(object.dimensions)
    empty.show_in_front = True
    empty.parent = object  # it goes where the object goes
    empty.matrix_parent_inverse = object.matrix_world.inverted_safe()
    empty.location = place
    return empty


def remove_empties(item: Any) -> None:
    """Removes those that _empty() made; others are the user's."""
    made = bpy.data.collections.get(COLLECTION)
    for empty in (item.source, item.target):
        if made and empty and empty.name in made.objects:
            bpy.data.objects.remove(empty)


def add_pairs(settings: Any, scene: bpy.types.Scene) -> int:
    """Makes a pair of each selected vertex of the source and that of the target."""
    source, target = settings.source, settings.target
    places = selected_places(source), selected_places(target)
    n, m = len(places[0]), len(places[1])
    if n != m or n == 0:
        raise UserError(
            f"Select as many vertices of {source.name} ({n}) as of {target.name} ({m}), "
            "in the same order"
        )
    for a, b in zip(*places):
        item = settings.landmarks.add()
        item.name = str(len(settings.landmarks))
        item.source = _empty(f"{source.name} {item.name}", a, source, scene)
        item.target = _empty(f"{target.name} {item.name}", b, target, scene)
    settings.active_landmark = len(settings.landmarks) - 1
    return n

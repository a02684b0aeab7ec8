"""Vertex groups, shape keys, UV maps, color attributes and wraps: read, carried, written.

Each function returns how many layers were written, and sentences for the user.
"""

import bpy
import numpy as np
from bpy.types import Object

from . import carry, uv
from .job import Mapped
from .surface import (
    Surface,
    UserError,
    inverse_of,
    matrix_of,
    mesh_of,
    moved,
    numbers,
    read_surface,
)

Result = tuple[int, list[str]]
LEAST = 1e-5  # a smaller weight is none


def read_again(mapped: Mapped, source: Object, target: Object) -> tuple[Surface, Surface]:
    """Both surfaces as they are now.

    Raises:
        UserError: the faces are not those that were mapped.
    """
    surfaces = []
    for object, before, is_reflected in (
        (source, mapped.source, mapped.is_reflected),
        (target, mapped.target, False),
    ):
        now = read_surface(object, mapped.is_evaluated, is_reflected)
        if now.topology != before.topology:
            raise UserError(f"{object.name} has other faces than those that were mapped: map again")
        surfaces.append(now)
    return surfaces[0], surfaces[1]


def _check_editable(object: Object, other: Object) -> None:
    if object.data == other.data:
        raise UserError(f"{object.name} and {other.name} share one mesh: make it single-user")
    if object.data.library is not None:
        raise UserError(f"The mesh of {object.name} is linked from another file")


def _missing(is_known: np.ndarray, what: str) -> list[str]:
    n = len(is_known) - int(is_known.sum())
    return [f"{n} {what} are not covered and have no neighbours that are: they stay"] if n else []


def vertex_groups(mapped: Mapped, source: Object, target: Object) -> Result:
    _check_editable(target, source)
    groups = source.vertex_groups
    if not groups:
        raise UserError(f"{source.name} has no vertex groups")
    weights = np.zeros((len(mapped.source.positions), len(groups)))
    with mesh_of(source, mapped.is_evaluated) as mesh:
        for vertex in mesh.vertices:
            for element in vertex.groups:
                weights[vertex.index, element.group] = element.weight
    values, is_known = carry.to_vertices(mapped.map, weights)
    values, is_known = carry.spread(values, is_known, mapped.target.triangles)
    known = np.flatnonzero(is_known)
    for group, column in zip(groups, values.T):
        copy = target.vertex_groups.get(group.name) or target.vertex_groups.new(name=group.name)
        copy.remove(known.tolist())
        for i in known[column[known] > LEAST].tolist():
            copy.add([i], column[i], "REPLACE")
        copy.lock_weight = group.lock_weight
    return len(groups), _missing(is_known, "vertices")


def _coordinates(key: bpy.types.ShapeKey) -> np.ndarray:
    return numbers(key.data, "co", 3, np.float32).astype(float)


def _need_own_vertices(object: Object, mapped: Surface) -> None:
    if len(object.data.vertices) != len(mapped.positions):
        raise UserError(
            f"The modifiers of {object.name} change its vertices: map without modifiers"
        )


def shape_keys(mapped: Mapped, source: Object, target: Object) -> Result:
    _check_editable(target, source)
    keys = source.data.shape_keys
    if keys is None or len(keys.key_blocks) < 2:
        raise UserError(f"{source.name} has no shape keys beside its basis")
    _need_own_vertices(source, mapped.source)
    basis = keys.reference_key
    carried_keys = [key for key in keys.key_blocks if key != basis]
    rest = _coordinates(basis)
    moves, is_known = carry.to_shape(
        mapped.map,
        mapped.source,
        mapped.target,
        np.array([_coordinates(key) - rest for key in carried_keys]),
    )
    if target.data.shape_keys is None:
        target.shape_key_add(name=basis.name, from_mix=False)
    base = target.data.shape_keys.reference_key
    blocks = target.data.shape_keys.key_blocks
    at_rest = _coordinates(base)
    copies = {basis.name: base}
    for key, move in zip(carried_keys, moves):
        copy = blocks.get(key.name)
        if copy is None or copy == base:
            copy = target.shape_key_add(name=key.name, from_mix=False)
        copy.data.foreach_set("co", (at_rest + move).astype(np.float32).ravel())
        copy.slider_min, copy.slider_max = key.slider_min, key.slider_max
        copies[key.name] = copy
    for key in carried_keys:  # now that all exist
        copies[key.name].relative_key = copies[key.relative_key.name]
    target.data.update()
    return len(carried_keys), _missing(is_known, "vertices")


def _next_loops(mesh: bpy.types.Mesh) -> np.ndarray:
    start = numbers(mesh.polygons, "loop_start", 1, np.int32)
    total = numbers(mesh.polygons, "loop_total", 1, np.int32)
    following = np.arange(1, len(mesh.loops) + 1)
    following[start + total - 1] = start
    return following


def uv_maps(mapped: Mapped, source: Object, target: Object, marks_seams: bool) -> Result:
    _check_editable(target, source)
    with mesh_of(source, mapped.is_evaluated) as mesh:
        layers = [
            (layer.name, numbers(layer.data, "uv", 2, np.float32).astype(float))
            for layer in mesh.uv_layers
        ]
        active = mesh.uv_layers.active.name if layers else ""
    if not layers:
        raise UserError(f"{source.name} has no UV maps")
    mesh, sentences = target.data, []
    for name, values in layers:
        if name not in mesh.uv_layers and mesh.uv_layers.new(name=name, do_init=False) is None:
            raise UserError(f"{target.name} has no room for the UV map {name}")
        carried = uv.carry_uv(mapped.map, mapped.source, mapped.target, values)
        data = mesh.uv_layers[name].data
        is_known = np.isfinite(carried[:, 0])
        now = numbers(data, "uv", 2, np.float32)
        data.foreach_set("uv", np.where(is_known[:, None], carried, now).astype(np.float32).ravel())
        if not is_known.all():
            n = len(np.unique(np.repeat(np.arange(len(mesh.polygons)), _totals(mesh))[~is_known]))
            sentences.append(f"{n} faces are not covered: they keep what {name} has there")
        if marks_seams and name == active:
            _mark_seams(mesh, carried)
    mesh.uv_layers.active = mesh.uv_layers[active]
    mesh.update()
    return len(layers), sentences


def _totals(mesh: bpy.types.Mesh) -> np.ndarray:
    return numbers(mesh.polygons, "loop_total", 1, np.int32)


def _mark_seams(mesh: bpy.types.Mesh, coordinates: np.ndarray) -> None:
    vertices = numbers(mesh.loops, "vertex_index", 1, np.int32)
    edges = numbers(mesh.loops, "edge_index", 1, np.int32)
    is_seam = numbers(mesh.edges, "use_seam", 1, bool)
    is_seam[uv.seams_of(coordinates, vertices, edges, _next_loops(mesh))] = True
    mesh.edges.foreach_set("use_seam", is_seam)


def color_attributes(mapped: Mapped, source: Object, target: Object) -> Result:
    _check_editable(target, source)
    with mesh_of(source, mapped.is_evaluated) as mesh:
        attributes = [
            (a.name, a.data_type, a.domain, numbers(a.data, "color", 4, np.float32).astype(float))
            for a in mesh.color_attributes
        ]
    if not attributes:
        raise UserError(f"{source.name} has no color attributes")
    sentences = []
    for name, kind, domain, values in attributes:
        if domain == "CORNER":
            carried, is_known = _colors_of_loops(mapped, values)
        else:
            carried, is_known = carry.to_vertices(mapped.map, values)
            carried, is_known = carry.spread(carried, is_known, mapped.target.triangles)
        copy = target.data.color_attributes.get(name)
        if copy is not None and (copy.domain, copy.data_type) != (domain, kind):
            target.data.color_attributes.remove(copy)
            copy = None
        copy = copy or target.data.color_attributes.new(name, kind, domain)
        now = numbers(copy.data, "color", 4, np.float32)
        copy.data.foreach_set(
            "color", np.where(is_known[:, None], carried, now).astype(np.float32).ravel()
        )
        sentences += _missing(is_known, "vertices" if domain == "POINT" else "face corners")
    target.data.update()
    return len(attributes), sentences


def _colors_of_loops(mapped: Mapped, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Face corners that are not covered get the mean color of their vertex, filled as others."""
    surface = mapped.target
    carried, is_known = carry.to_loops(mapped.map, mapped.source, surface, values)
    vertex = np.empty(surface.n_loops, np.int32)
    vertex[surface.loops.ravel()] = surface.triangles.ravel()
    n = len(surface.positions)
    count = np.bincount(vertex[is_known], minlength=n)
    mean = carry.sums(vertex[is_known], carried[is_known], n) / np.maximum(count, 1)[:, None]
    mean, reached = carry.spread(mean, count > 0, surface.triangles)
    return np.where(is_known[:, None], carried, mean[vertex]), is_known | reached[vertex]


def wrap(mapped: Mapped, source: Object, target: Object, is_in_place: bool) -> Result:
    """The target's shape as a shape key of the source, named like the target.

    Args:
        is_in_place: the shape appears at the source, with the coordinates that it has in the space
            of the target; else it appears where the target is.
    """
    _check_editable(source, target)
    _need_own_vertices(source, mapped.source)
    here, there = read_again(mapped, source, target)
    positions, n = carry.wrapped(mapped.map, here, there)
    if n == len(positions):
        raise UserError(f"The map covers no vertex of {source.name}")
    if is_in_place:
        matrix, name = matrix_of(target, mapped.is_reflected), target.name
    else:
        matrix, name = here.matrix, source.name
    positions = moved(inverse_of(matrix, name), positions)
    if source.data.shape_keys is None:
        source.shape_key_add(name="Basis", from_mix=False)
    keys = source.data.shape_keys
    key = keys.key_blocks.get(target.name)
    if key is None or key == keys.reference_key:
        key = source.shape_key_add(name=target.name, from_mix=False)
    key.data.foreach_set("co", positions.astype(np.float32).ravel())
    key.value = 1.0
    source.data.update()
    return 1, [f"{n} vertices have no image: they follow their neighbours"] if n else []

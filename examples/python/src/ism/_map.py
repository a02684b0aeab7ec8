"""Maps: points, vertices and values from one mesh to the other."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _library as lib
from ._input import integers
from ._library import InputError, library

c = lib.c


class Points(NamedTuple):
    """Points of a surface, e.g. images. Those that do not exist have face -1.

    Attributes:
        faces: (n,) int32, the triangles that contain them.
        barycentric: (n, 3) float64, coordinates in these triangles, at least 0 with sum 1.
        positions: (n, 3) float64, in the unit of the mesh; NaN where there is no point.
    """

    faces: np.ndarray
    barycentric: np.ndarray
    positions: np.ndarray

    @property
    def covered(self) -> np.ndarray:
        """(n,) bool: which of the points exist."""
        return self.faces >= 0


class Meta(NamedTuple):
    """The common refinement of A and B: polygons of 3 to 6 corners, with two geometries.

    The corners of polygon p are ``corners[offsets[p]:offsets[p + 1]]``, counter-clockwise. The
    arrays are read-only and belong to the library; copy what you want to change.

    Attributes:
        on_a, on_b: (m, 3), positions of the vertices on either surface, in its unit.
        plane: (m, 2), their positions in the common plane.
        face_a, face_b: (p,), the triangles of A and of B that contain each polygon.
        offsets: (p + 1,), where each polygon begins in ``corners``.
        corners: (k,), vertices of the meta mesh.
        corner_a, corner_b: (k, 3), barycentric coordinates of the corners in face_a, in face_b.
    """

    on_a: np.ndarray
    on_b: np.ndarray
    plane: np.ndarray
    face_a: np.ndarray
    face_b: np.ndarray
    offsets: np.ndarray
    corners: np.ndarray
    corner_a: np.ndarray
    corner_b: np.ndarray


class Distortion(NamedTuple):
    """Symmetric Dirichlet energy per area: 2 where the map is an isometry, else more.

    Surfaces are scaled as in the run: to area 1, unless ``keep_scale`` is set.

    Attributes:
        mean, median, p95, largest: over both surfaces, weighted by area.
        sigma_min, sigma_max: the extreme singular values, that is factors of lengths.
        area_a, area_b: of the covered parts.
        polygons: (p, 5), per polygon of the meta mesh: area on A, area on B, smallest and largest
            singular value, distortion. Read-only.
    """

    mean: float
    median: float
    p95: float
    largest: float
    sigma_min: float
    sigma_max: float
    area_a: float
    area_b: float
    polygons: np.ndarray


class Handle:
    """A map of the library, freed when nothing refers to it any more; arrays may."""

    _free = library.ism_map_free  # also when Python ends

    def __init__(self, pointer: Any):
        self.pointer = pointer

    def __del__(self) -> None:
        self._free(self.pointer)

    def array(self, address: int, kind: Any, *shape: int) -> np.ndarray:
        """A read-only view of the library's memory."""
        n = int(np.prod(shape))
        if n == 0:
            return np.empty(shape, kind)
        memory = (kind * n).from_address(address)
        memory.owner = self  # the array keeps `memory`
        array = np.frombuffer(memory, kind).reshape(shape)
        array.flags.writeable = False
        return array

    def meta(self) -> lib.Meta:
        result = lib.Meta()
        lib.call("ism_map_meta", self.pointer, c.byref(result))
        return result


def _element(name: str) -> int:
    if name not in lib.ELEMENTS:
        raise InputError(f"an element must be one of {', '.join(lib.ELEMENTS)}, not {name!r}")
    return lib.ELEMENTS.index(name)


def _like(values: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Numbers as the type of what was given: integers are rounded and clipped."""
    if dtype.kind not in "iu":
        return values if dtype.kind == "b" else values.astype(dtype, copy=False)
    limits = np.iinfo(dtype)
    rounded = np.rint(values)
    with np.errstate(invalid="ignore"):
        result = rounded.astype(dtype)
    result[rounded >= limits.max] = limits.max  # as float64, the limits of int64 are rounded
    result[rounded <= limits.min] = limits.min
    return result


class Direction:
    """The map from one mesh to the other: ``m.a_to_b`` or ``m.b_to_a``. Call it to map points.

    ======================================  ====================================================
    ``m.a_to_b()``                          images on B of all vertices of A
    ``m.a_to_b([3, 17])``                   of these vertices
    ``m.a_to_b(faces, barycentric)``        of points in triangles of A
    ``m.a_to_b(points)``                    of :class:`Points`, e.g. images under ``m.b_to_a``
    ``m.a_to_b.transfer(colors)``           values at vertices of A, at the vertices of B
    ``m.a_to_b.matrix``                     the same as a sparse matrix
    ======================================  ====================================================

    Any thread may use it.
    """

    def __init__(self, handle: Handle, side: int, n_vertices: int):
        self._handle = handle
        self._side = side
        self._n_vertices = n_vertices

    def __repr__(self) -> str:
        return f"<ism: from {'AB'[self._side]} to {'BA'[self._side]}>"

    def __call__(
        self,
        points: Union[Points, Sequence[int], np.ndarray, int, None] = None,
        barycentric: Optional[np.ndarray] = None,
    ) -> Points:
        """Maps points to the other mesh.

        Args:
            points: (n,) integers: vertices, or triangles if there are barycentric coordinates;
                or :class:`Points`; or nothing, for all vertices. Triangle -1 is no point.
            barycentric: (n, 3), at least 0 with sum 1.

        Returns:
            The images, in the same order. Where the map does not cover the surface, face -1.

        Raises:
            InputError: an id is out of range, or coordinates are not what they should be.
        """
        if points is None:
            points = np.arange(self._n_vertices, dtype=np.int32)
        elif isinstance(points, Points):
            barycentric, points = points.barycentric, points.faces
        ids = np.ascontiguousarray(np.atleast_1d(integers(points, "points")))
        if ids.ndim != 1:
            raise InputError(f"points must have shape (n,), not {ids.shape}")
        places = None
        if barycentric is not None:
            places = np.ascontiguousarray(barycentric, np.float64)
            places = places[None] if places.ndim == 1 else places
            if places.shape != (len(ids), 3):
                raise InputError(
                    f"barycentric must have shape ({len(ids)}, 3), not {np.shape(barycentric)}"
                )
        return self._images(ids, places)

    def _images(self, ids: np.ndarray, places: Optional[np.ndarray]) -> Points:
        n = len(ids)
        result = Points(np.empty(n, np.int32), np.empty((n, 3)), np.empty((n, 3)))
        lib.call(
            "ism_map_images",
            self._handle.pointer,
            self._side,
            n,
            ids.ctypes.data,
            None if places is None else places.ctypes.data,
            *(array.ctypes.data for array in result),
        )
        return result

    def csr(
        self, source: str = "vertex", target: str = "vertex"
    ) -> Tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """The sparse matrix of :meth:`transfer`, as plain arrays that are read-only.

        Returns:
            offsets (rows + 1,), sources and weights (nonzeros,), and the number of columns: value i
            of the target is the sum of ``weights[k]`` times value ``sources[k]``, for k from
            ``offsets[i]`` to ``offsets[i + 1] - 1``.
        """
        t = lib.Transfer()
        kinds = _element(source), _element(target)
        lib.call("ism_map_transfer", self._handle.pointer, self._side, *kinds, c.byref(t))
        offsets = self._handle.array(t.offsets, c.c_int32, t.n_rows + 1)
        n = int(offsets[-1])
        sources = self._handle.array(t.sources, c.c_int32, n)
        return offsets, sources, self._handle.array(t.weights, c.c_double, n), t.n_sources

    @property
    def matrix(self) -> Any:
        """The matrix from vertices to vertices, as a ``scipy.sparse.csr_matrix``; needs scipy.

        A row per vertex of the mesh that is mapped to. Rows sum to 1; those of vertices that are
        not covered are empty.
        """
        return self.matrix_of()

    def matrix_of(self, source: str = "vertex", target: str = "vertex") -> Any:
        """The same between other elements: ``"vertex"``, ``"face"`` or ``"corner"``."""
        from scipy.sparse import csr_matrix

        offsets, sources, weights, n = self.csr(source, target)
        return csr_matrix((weights, sources, offsets), shape=(len(offsets) - 1, n), copy=True)

    def transfer(
        self, values: Any, source: str = "vertex", target: str = "vertex", fill: float = 0
    ) -> np.ndarray:
        """Carries values to the other mesh.

        Args:
            values: a row per source element, of any further shape: (#, ...), numbers of any type.
            source, target: ``"vertex"``, ``"face"`` or ``"corner"``; corner k of triangle f has
                row 3 f + k.
            fill: the value where the map does not cover an element; an integer, if values are.

        Returns:
            A row per target element, of the same type; integers are rounded, booleans become
            weights from 0 to 1.
        """
        offsets, sources, weights, n = self.csr(source, target)
        array = np.asarray(values)
        if array.dtype.kind not in "biufc" or array.shape[:1] != (n,):
            raise InputError(
                f"values must be numbers with a row for each {source}, ({n}, ...), "
                f"not {array.dtype} of shape {array.shape}"
            )
        if array.dtype.kind in "iu":
            fill = array.dtype.type(fill)
        is_covered = offsets[1:] > offsets[:-1]
        flat = array.reshape(n, -1)
        result = np.full((len(is_covered), flat.shape[1]), fill, np.result_type(float, array.dtype))
        if len(sources) and flat.shape[1]:
            terms = weights[:, None] * flat[sources]
            result[is_covered] = np.add.reduceat(terms, offsets[:-1][is_covered], axis=0)
        return _like(result, array.dtype).reshape((len(is_covered),) + array.shape[1:])


class Map:
    """An injective map between the meshes A and B, the result of :func:`ism.map`.

    Attributes:
        a_to_b, b_to_a: the two directions, see :class:`Direction`.
        status: how the run ended: ``"converged"``, ``"iteration limit"``, ``"time limit"``,
            ``"cancelled"``, ``"stalled"``, or ``"unfinished"``.
        message: the same as a sentence.
        warnings: sentences about what may make the map useless.
        coverage: the parts of the areas of A and of B that are covered, 0 to 1.
        iterations, seconds: what the run took.
    """

    def __init__(self, pointer: Any, state: Any, n_a: int, n_b: int):
        self._handle = Handle(pointer)
        self.a_to_b = Direction(self._handle, 0, n_a)
        self.b_to_a = Direction(self._handle, 1, n_b)
        self.status: str = state.status
        self.message: str = state.message
        self.warnings: Tuple[str, ...] = tuple(w.message for w in state.warnings)
        self.coverage: Tuple[float, float] = state.coverage
        self.iterations: int = state.iterations
        self.seconds: float = state.seconds
        self._mean: float = state.distortion

    def __repr__(self) -> str:
        a, b = self.coverage
        return (
            f"<ism.Map: {self.status}, distortion {self._mean:.4f}, "
            f"coverage {a:.1%} of A, {b:.1%} of B>"
        )

    @property
    def matrix(self) -> Any:
        """``a_to_b.matrix``: values at vertices of A to vertices of B. Needs scipy."""
        return self.a_to_b.matrix

    @property
    def meta(self) -> Meta:
        """The common refinement of A and B, see :class:`Meta`."""
        m, array = self._handle.meta(), self._handle.array
        return Meta(
            array(m.on_a, c.c_double, m.n_vertices, 3),
            array(m.on_b, c.c_double, m.n_vertices, 3),
            array(m.plane, c.c_double, m.n_vertices, 2),
            array(m.face_a, c.c_int32, m.n_polygons),
            array(m.face_b, c.c_int32, m.n_polygons),
            array(m.offsets, c.c_int32, m.n_polygons + 1),
            array(m.corners, c.c_int32, m.n_corners),
            array(m.corner_a, c.c_double, m.n_corners, 3),
            array(m.corner_b, c.c_double, m.n_corners, 3),
        )

    @property
    def distortion(self) -> Distortion:
        """The distortion, in all and of each polygon of the meta mesh, see :class:`Distortion`."""
        m = self._handle.meta()
        polygons = self._handle.array(m.distortion, c.c_double, m.n_polygons, 5)
        return Distortion(**{name: getattr(m, name) for name in lib.SUMMARY}, polygons=polygons)

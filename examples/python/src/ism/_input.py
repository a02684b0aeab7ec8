"""What users pass, as the structures of the library. Arrays that fit are not copied."""

from __future__ import annotations

import operator
from typing import Any, List, Tuple

import numpy as np

from . import _library as lib
from ._library import InputError

INT32 = np.iinfo(np.int32)


def _numbers(values: Any, kinds: str, name: str) -> np.ndarray:
    """An array of numbers whose types are of these kinds; empty ones may be of any."""
    array = np.asarray(values)
    if array.dtype.kind not in kinds and array.size:
        what = "integers" if kinds == "iu" else "numbers"
        raise InputError(f"{name} must be {what}, not {array.dtype}")
    return array


def _rows(array: np.ndarray, name: str) -> np.ndarray:
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} must have shape (#, 3), not {array.shape}")
    if array.shape[0] > INT32.max:
        raise InputError(f"{name} has too many rows: {array.shape[0]}")
    return array


def _in_place(array: np.ndarray, *types: Any) -> np.ndarray:
    """The array, if its type is one of these and each row is contiguous; else a copy."""
    row, item = array.strides
    is_plain = array.dtype in types and item == array.itemsize
    if is_plain and 3 * item <= row <= INT32.max:
        return array
    return np.ascontiguousarray(array, array.dtype if array.dtype in types else types[-1])


def _stride(array: np.ndarray) -> int:
    """Bytes between rows; that of arrays with less than two is anything."""
    return max(array.strides[0], 3 * array.itemsize)


def integers(values: Any, name: str) -> np.ndarray:
    """An int32 array, of the same shape, of integers of any type."""
    array = _numbers(values, "iu", name)
    if array.size and array.dtype != np.int32:
        for i in (array.min(), array.max()):
            if not INT32.min <= int(i) <= INT32.max:
                raise InputError(f"{name}: the id {i} is out of range")
    return array.astype(np.int32, copy=False)


def mesh(given: Any, name: str) -> Tuple[lib.Mesh, List[np.ndarray]]:
    """The structure, and the arrays that have to exist while it is used."""
    if hasattr(given, "vertices"):
        faces = getattr(given, "faces", None)
        pair = given.vertices, getattr(given, "triangles", None) if faces is None else faces
    else:
        pair = given
    try:
        vertices, faces = pair
    except (TypeError, ValueError):
        faces = None
    if faces is None:
        raise TypeError(f"{name} must be (vertices, faces), or have .vertices and .faces")
    x = _numbers(vertices, "fiu", f"vertices of {name}")
    x = _in_place(_rows(x, f"vertices of {name}"), np.dtype("f4"), np.dtype("f8"))
    f = _rows(integers(faces, f"faces of {name}"), f"faces of {name} (triangulate polygons first)")
    f = _in_place(f, np.dtype("i4"))
    structure = lib.Mesh(x.ctypes.data, f.ctypes.data, len(x), len(f), _stride(x), _stride(f))
    structure.position_type = x.itemsize // 8  # ISM_FLOAT, ISM_DOUBLE
    return structure, [x, f]


def _end(end: Any, name: str) -> Tuple[int, Tuple[float, float, float]]:
    """An id, and the barycentric coordinates: zeros for a vertex."""
    try:
        return int(integers(operator.index(end), name)), (0.0, 0.0, 0.0)
    except TypeError:
        pass
    try:
        face, point = end
        u, v, w = (float(x) for x in point)
        return int(integers(operator.index(face), name)), (u, v, w)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a vertex, or (face, (u, v, w)), not {end!r}") from None


def landmarks(given: Any) -> Any:
    """An array of structures."""
    pairs = [] if given is None else list(given)
    result = (lib.Landmark * len(pairs))()
    for i, pair in enumerate(pairs):
        name = f"landmark {i}"
        try:
            a, b, *weight = pair
            (w,) = weight or [8.0]
        except (TypeError, ValueError):
            raise InputError(f"{name} must be (a, b) or (a, b, weight), not {pair!r}") from None
        (ia, pa), (ib, pb) = _end(a, f"a of {name}"), _end(b, f"b of {name}")
        result[i] = lib.Landmark(ia, ib, float(w), pa, pb)
    return result


def _choice(value: Any, names: Tuple[str, ...], option: str) -> int:
    if value not in names:
        raise InputError(f"{option} must be one of {', '.join(names)}, not {value!r}")
    return names.index(value)


def options(given: dict) -> Tuple[lib.Options, List[np.ndarray]]:
    """The structure, and the arrays that have to exist while it is used."""
    result = lib.Options(size=lib.c.sizeof(lib.Options))
    lib.call("ism_default_options", lib.c.byref(result))
    kept = []
    for name, value in given.items():
        if name == "measure":
            result.measure = _choice(value, lib.MEASURES, name)
        elif name == "boundary":
            result.boundary = _choice(value, lib.BOUNDARIES, name)
        elif name in ("pins_a", "pins_b"):
            kept.append(np.ascontiguousarray(integers(value, name)).ravel())
            setattr(result, name, kept[-1].ctypes.data)
            setattr(result, "n_" + name, len(kept[-1]))
        elif name in lib.INTEGERS:
            setattr(result, name, int(integers(operator.index(value), name)))
        elif name in lib.FLAGS:
            setattr(result, name, bool(value))
        elif name in lib.NUMBERS:
            setattr(result, name, float(value))
        else:
            known = ["measure", "boundary", "pins_a", "pins_b"]
            known += lib.INTEGERS + lib.FLAGS + lib.NUMBERS
            raise TypeError(f"there is no option {name!r}; there are {', '.join(sorted(known))}")
    return result, kept

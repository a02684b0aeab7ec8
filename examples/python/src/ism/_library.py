"""The shared library, the structures of ism_c.h, and its errors as exceptions."""

from __future__ import annotations

import ctypes as c
import pathlib
import sys
from typing import Any, NamedTuple, Sequence, Tuple

DONE, UNFINISHED, NO_MAP_YET, BAD_ARGUMENT, BUSY, OUT_OF_MEMORY = 0, 6, 7, 100, 101, 102
SIDES = ("a", "b")
ELEMENTS = ("vertex", "face", "corner")
MEASURES = ("symmetric_dirichlet", "arap", "sarap", "asap")
BOUNDARIES = ("free", "fixed", "slide")

PROGRESS = c.CFUNCTYPE(c.c_int32, c.c_void_p, c.c_double, c.c_char_p)


class Mesh(c.Structure):
    _fields_ = [("positions", c.c_void_p), ("triangles", c.c_void_p)] + [
        (name, c.c_int32)
        for name in "n_vertices n_triangles position_stride triangle_stride position_type".split()
    ]


class Landmark(c.Structure):
    _fields_ = [
        ("a", c.c_int32),
        ("b", c.c_int32),
        ("weight", c.c_double),
        ("barycentric_a", c.c_double * 3),
        ("barycentric_b", c.c_double * 3),
    ]


INTEGERS = "max_iterations history_length coarsest threads outer_a outer_b".split()
FLAGS = "keep_scale exact_landmarks weld candidates as_published".split()
NUMBERS = "coverage_weight tolerance refine omega_start max_seconds".split()


class Options(c.Structure):
    _fields_ = (
        [("size", c.c_uint32), ("measure", c.c_int32), ("boundary", c.c_int32)]
        + [(name, c.c_int32) for name in INTEGERS + FLAGS]
        + [(name, c.c_double) for name in NUMBERS]
        + [("pins_a", c.c_void_p), ("pins_b", c.c_void_p)]
        + [("n_pins_a", c.c_int32), ("n_pins_b", c.c_int32)]
        + [("progress", PROGRESS), ("user", c.c_void_p)]
    )


class ElementId(c.Structure):
    _fields_ = [("side", c.c_int32), ("element", c.c_int32), ("id", c.c_int32)]


class Message(c.Structure):
    _fields_ = [("sentence", c.c_char_p), ("ids", c.POINTER(ElementId)), ("n_ids", c.c_int32)]


class Result(c.Structure):
    _fields_ = (
        [("message", Message), ("warnings", c.POINTER(Message))]
        + [("n_warnings", c.c_int32), ("n_iterations", c.c_int32)]
        + [(x, c.c_double) for x in "fraction distortion coverage_a coverage_b seconds".split()]
        + [("status", c.c_int32)]
    )


SUMMARY = "mean median p95 largest sigma_min sigma_max area_a area_b".split()


class Meta(c.Structure):
    _fields_ = (
        [(name, c.c_int32) for name in "n_vertices n_polygons n_corners".split()]
        + [(x, c.c_void_p) for x in "on_a on_b plane face_a face_b offsets corners".split()]
        + [(name, c.c_void_p) for name in "corner_a corner_b distortion".split()]
        + [(name, c.c_double) for name in SUMMARY]
    )


class Transfer(c.Structure):
    _fields_ = [("n_rows", c.c_int32), ("n_sources", c.c_int32)] + [
        (name, c.c_void_p) for name in "offsets sources weights".split()
    ]


def load() -> c.CDLL:
    name = {"win32": "ism_c.dll", "darwin": "libism_c.dylib"}.get(sys.platform, "libism_c.so")
    library = c.CDLL(str(pathlib.Path(__file__).with_name(name)))
    handle, number, array = c.c_void_p, c.c_int32, c.c_void_p
    arguments = {
        "ism_default_options": [c.POINTER(Options)],
        "ism_run_create": [c.POINTER(Mesh), c.POINTER(Mesh), c.POINTER(Landmark), number]
        + [c.POINTER(Options), c.POINTER(handle)],
        "ism_run_advance": [handle, number, c.c_double],
        "ism_run_result": [handle, c.POINTER(Result)],
        "ism_run_cancel": [handle, number],
        "ism_run_free": [handle],
        "ism_map_create": [handle, c.POINTER(handle)],
        "ism_map_free": [handle],
        "ism_map_images": [handle, number, number, array, array, array, array, array],
        "ism_map_meta": [handle, c.POINTER(Meta)],
        "ism_map_transfer": [handle, number, number, number, c.POINTER(Transfer)],
    }
    for name, types in arguments.items():
        getattr(library, name).argtypes = types
        getattr(library, name).restype = c.c_int32
    library.ism_map_free.restype = None
    library.ism_last_error.restype = c.c_char_p
    library.ism_status_name.restype = c.c_char_p
    library.ism_status_name.argtypes = [number]
    return library


library = load()


class Id(NamedTuple):
    """An element of a given mesh, e.g. ``Id(side='a', element='vertex', id=17)``."""

    side: str
    element: str
    id: int


class Error(Exception):
    """A run or a call failed.

    Attributes:
        status: how, in words, e.g. ``"invalid mesh"``.
        ids: the offending elements, a tuple of :class:`Id`.
    """

    def __init__(self, message: str, status: str = "failed call", ids: Sequence[Id] = ()):
        super().__init__(message)
        self.status = status
        self.ids: Tuple[Id, ...] = tuple(ids)


class InputError(Error, ValueError):
    """Meshes, landmarks, options or ids are not what they should be."""


class BusyError(Error):
    """Another thread uses this run."""


class OutOfMemoryError(Error, MemoryError):
    """There was not enough memory. A run that was advancing is lost."""


def status_name(status: int) -> str:
    return library.ism_status_name(status).decode()


def error_of(status: int, message: str, ids: Sequence[Id] = ()) -> Error:
    if status == BUSY:
        return BusyError(message, "busy")
    if status == OUT_OF_MEMORY:
        return OutOfMemoryError(message, "out of memory")
    name = "invalid input" if status == BAD_ARGUMENT else status_name(status)
    is_input = status == BAD_ARGUMENT or name.startswith("invalid")
    return (InputError if is_input else Error)(message, name, ids)


def call(name: str, *arguments: Any) -> int:
    """Calls a function of the library; raises an exception if the call failed."""
    status = getattr(library, name)(*arguments)
    if status >= BAD_ARGUMENT:
        raise error_of(status, library.ism_last_error().decode())
    return status

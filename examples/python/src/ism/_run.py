"""Runs: the optimisation in steps, and to the end."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import warnings
from typing import Any, Callable, Iterator, NamedTuple, Optional, Tuple, Union

from . import _input
from . import _library as lib
from ._library import Error, Id, library
from ._map import Map

c = lib.c
Progress = Callable[[float, str], Optional[bool]]


class Warning(UserWarning):
    """A finding that did not stop a run, but may make its map useless."""


class Message(NamedTuple):
    """A sentence for the user, and the elements that it names."""

    message: str
    ids: Tuple[Id, ...]


class State(NamedTuple):
    """The state of a run, as if it ended here. Times in seconds; fraction and coverage in [0, 1].

    ``distortion`` is the mean over the surfaces, 2 for an isometry (of the default measure); it and
    ``coverage``, of A and of B, are 0 before there is a map.
    """

    status: str
    message: str
    ids: Tuple[Id, ...]
    warnings: Tuple[Message, ...]
    fraction: float
    iterations: int
    distortion: float
    coverage: Tuple[float, float]
    seconds: float
    has_map: bool


def _message(m: lib.Message) -> Message:
    ids = (m.ids[i] for i in range(m.n_ids))
    return Message(
        m.sentence.decode(),
        tuple(Id(lib.SIDES[x.side], lib.ELEMENTS[x.element], x.id) for x in ids),
    )


class _Teller:
    """Called by the library while it works, in its thread; Python then handles signals, too."""

    def __init__(self, progress: Optional[Progress]):
        self.progress = progress
        self.error: Optional[BaseException] = None

    def __call__(self, _user: Any, fraction: float, what: bytes) -> int:
        if self.progress is None:
            return 1
        try:
            answer = self.progress(fraction, what.decode())
        except BaseException as error:  # cancels, and is raised when the library has returned
            self.error = error
            return 0
        return 1 if answer is None or answer else 0

    def raise_error(self) -> None:
        error, self.error = self.error, None
        if error is not None:
            raise error


class Run:
    """The optimisation in steps, for programs with other work to do.

    ::

        run = ism.Run(a, b)
        while run.advance(seconds=0.05):
            show(run.state())

    One thread at a time may use it, else :class:`BusyError` is raised; only :meth:`cancel` may be
    called at any time. Arguments are those of :func:`ism.map`, except the bar.
    """

    _free = library.ism_run_free  # also when Python ends

    def __init__(
        self,
        a: Any,
        b: Any,
        landmarks: Any = None,
        *,
        progress: Optional[Progress] = None,
        **options: Any,
    ):
        self._pointer = c.c_void_p()
        self._teller = _Teller(progress)
        self._callback = lib.PROGRESS(self._teller)
        mesh_a, kept_a = _input.mesh(a, "a")
        mesh_b, kept_b = _input.mesh(b, "b")
        structure, kept = _input.options(options)
        structure.progress = self._callback
        pairs = _input.landmarks(landmarks)
        lib.call(
            "ism_run_create",
            c.byref(mesh_a),
            c.byref(mesh_b),
            pairs,
            len(pairs),
            c.byref(structure),
            c.byref(self._pointer),
        )
        del kept_a, kept_b, kept  # the library has read them
        self._sizes = mesh_a.n_vertices, mesh_b.n_vertices

    def __del__(self) -> None:
        if getattr(self, "_pointer", None):
            self._free(self._pointer)

    def __repr__(self) -> str:
        try:
            return f"<ism.Run: {self.state().status}>"
        except Error as error:
            return f"<ism.Run: {error.status}>"

    @contextlib.contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Ctrl-C cancels the call inside; then KeyboardInterrupt is raised."""
        is_main = threading.current_thread() is threading.main_thread()
        if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
            yield
            return
        interrupted = []

        def interrupt(_number: Any, _frame: Any) -> None:
            interrupted.append(True)
            self.cancel()

        signal.signal(signal.SIGINT, interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if interrupted:
                self.cancel(False)
        if interrupted:
            raise KeyboardInterrupt

    def advance(self, seconds: Optional[float] = None, steps: int = 0) -> bool:
        """Works for some seconds, or for a number of steps, or, without either, to the end.

        A step takes milliseconds to some tenths of a second for 10,000 vertices. Other Python
        threads run meanwhile. After Ctrl-C or an exception of ``progress``, which is raised, the
        run can go on.

        Returns:
            True while there is more to do.

        Raises:
            InputError: the meshes, landmarks or options cannot be used.
            BusyError: another thread uses the run.
        """
        limit = math.inf if seconds is None else float(seconds)
        with self._interruptible():
            status = lib.call("ism_run_advance", self._pointer, int(steps), limit)
        self._teller.raise_error()
        if status > lib.NO_MAP_YET:
            state = self.state()
            raise lib.error_of(status, state.message, state.ids)
        return status == lib.UNFINISHED

    def cancel(self, cancelled: bool = True) -> None:
        """Stops what another thread does with this run, soon; False: it may go on."""
        lib.call("ism_run_cancel", self._pointer, int(cancelled))

    def state(self) -> State:
        """Describes the run. Costs as much as some steps while decimated surfaces are mapped."""
        r = lib.Result()
        lib.call("ism_run_result", self._pointer, c.byref(r))
        message = _message(r.message)
        return State(
            lib.status_name(r.status),
            message.message,
            message.ids,
            tuple(_message(r.warnings[i]) for i in range(r.n_warnings)),
            r.fraction,
            r.n_iterations,
            r.distortion,
            (r.coverage_a, r.coverage_b),
            r.seconds,
            r.status <= lib.UNFINISHED,
        )

    def map(self) -> Map:
        """The current map. It stays as it is when the run goes on.

        Raises:
            Error: there is no map yet.
        """
        state, pointer = self.state(), c.c_void_p()
        status = lib.call("ism_map_create", self._pointer, c.byref(pointer))
        if not pointer:
            raise lib.error_of(status, library.ism_last_error().decode(), state.ids)
        return Map(pointer, state, *self._sizes)


@contextlib.contextmanager
def _bar() -> Iterator[Optional[Progress]]:
    """A progress bar, if tqdm is installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        yield None
        return
    with tqdm(total=100, bar_format="{percentage:3.0f}%|{bar}| {elapsed} {desc}") as bar:

        def show(fraction: float, what: str) -> None:
            bar.set_description_str(what, refresh=False)
            bar.update(100 * fraction - bar.n)

        yield show


def map(
    a: Any,
    b: Any,
    landmarks: Any = None,
    *,
    progress: Union[Progress, bool, None] = None,
    **options: Any,
) -> Map:
    """Maps the triangle mesh A onto B: injective, continuous, of low distortion.

    Args:
        a, b: ``(vertices, faces)``, or anything with ``.vertices`` and ``.faces`` or
            ``.triangles``, e.g. meshes of trimesh and Open3D. Vertices: (#V, 3), any type of
            number, any unit. Faces: (#F, 3) integers from 0, counter-clockwise from outside. Rows
            of float32, float64 and int32 are read in place, other arrays are converted.
        landmarks: pairs ``(a, b)`` of corresponding vertices, e.g. an (n, 2) array, or
            ``(a, b, weight)``, where 8 is the usual weight. Instead of a vertex,
            ``(face, (u, v, w))`` is a point in a triangle.
        progress: a function of the finished fraction, 0 to 1, and a few words, called several times
            a second; it may return False to cancel. Or True for a bar, if tqdm is installed.
        options: see below.

    Returns:
        The map. After a cancellation, by ``progress`` or Ctrl-C, it is the best map so far, with
        the status ``"cancelled"``.

    Raises:
        InputError: the meshes, landmarks or options cannot be used. It has a sentence and ``ids``.
        KeyboardInterrupt: Ctrl-C was pressed before there was a map.

    Options, with their defaults; ``ism.hpp`` explains them all:
        ``max_iterations=1000``, ``tolerance=3e-4``, ``max_seconds=inf``: limits of the run.
        ``threads=0``: 0 is one per processor; results do not depend on it.
        ``exact_landmarks=False``: images of landmarks coincide; else they pull softly.
        ``boundary="free"``: or ``"fixed"``, ``"slide"``, which map boundaries onto each other.
        ``coverage_weight=0.2``: a larger weight gives more coverage and more distortion.
        ``measure="symmetric_dirichlet"``: or ``"arap"``, ``"sarap"``, ``"asap"``.
        ``keep_scale=False``: True for meshes in the same unit, which keep their sizes.
        ``candidates=True``, ``coarsest=400``, ``refine=8``: starts, coarse levels, long edges.
        ``weld=True``: repairs of a mesh may weld vertices.
        ``outer_a=-1``, ``outer_b=-1``: a vertex on the outline; -1: the longest boundary.
        ``pins_a=()``, ``pins_b=()``: vertices that keep their images from the start.
        ``history_length=6``, ``omega_start=1e4``, ``as_published=False``: of the method.
    """
    with contextlib.ExitStack() as stack:
        if isinstance(progress, bool):
            progress = stack.enter_context(_bar()) if progress else None
        run = Run(a, b, landmarks, progress=progress, **options)
        try:
            run.advance()
        except KeyboardInterrupt:
            if not run.state().has_map:
                raise
    result = run.map()
    for sentence in result.warnings:
        warnings.warn(sentence, Warning, stacklevel=2)
    return result

"""The computation, in a thread of its own, and the maps of this session."""

import threading
import uuid
from typing import Any, NamedTuple, Optional

from . import ism
from .surface import Surface

KEPT = 8  # maps that undo can return to


class Mapped(NamedTuple):
    """A map between surfaces, and how they were read."""

    map: ism.Map
    source: Surface
    target: Surface
    is_evaluated: bool
    is_reflected: bool


class Job:
    """A run. Its thread uses arrays only, never Blender's data.

    Attributes:
        fraction, what: how much is done, 0 to 1, and a few words.
        map: the result; None before the end, or if there is none.
        error: why there is none.
        state: of the run, at its end.
    """

    def __init__(self, source: Surface, target: Surface, landmarks: list, options: dict[str, Any]):
        self.source, self.target = source, target
        self.fraction, self.what = 0.0, ""
        self.map: Optional[ism.Map] = None
        self.error: Optional[Exception] = None
        self.state: Optional[ism.State] = None
        self._run = ism.Run(
            (source.positions, source.triangles),
            (target.positions, target.triangles),
            landmarks,
            progress=self._tell,
            **options,
        )
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _tell(self, fraction: float, what: str) -> None:
        self.fraction, self.what = fraction, what

    def _work(self) -> None:
        try:
            self._run.advance()
            self.state = self._run.state()
            self.map = self._run.map()
        except Exception as error:  # told by the operator, in the thread of the window
            self.error = error

    def wait(self, seconds: float) -> bool:
        """Waits at most so long; whether the run goes on."""
        self._thread.join(seconds)
        return self._thread.is_alive()

    def cancel(self) -> None:
        """Ends the run soon, with the map so far."""
        self._run.cancel()


current: Optional[Job] = None  # one at a time: it uses all processors
_maps: dict[str, Mapped] = {}


def start(*arguments: Any) -> Job:
    global current
    current = Job(*arguments)
    return current


def end() -> None:
    """Forgets the current job, and stops it if it still runs."""
    global current
    if current is not None:
        current.cancel()
        while current.wait(1):
            pass
    current = None


def keep(mapped: Mapped) -> str:
    """Keeps a map until Blender ends; the scene remembers its name, so that undo finds it."""
    name = uuid.uuid4().hex
    _maps[name] = mapped
    while len(_maps) > KEPT:
        del _maps[next(iter(_maps))]
    return name


def kept(name: str) -> Optional[Mapped]:
    return _maps.get(name)


def forget() -> None:
    end()
    _maps.clear()

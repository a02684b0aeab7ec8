"""Distortion-minimizing injective maps between triangle meshes.

::

    import ism
    m = ism.map((V_a, F_a), (V_b, F_b), landmarks=[(17, 4), (32, 90)])
    m.a_to_b([0, 1, 2]).positions     # where vertices of A go, on B
    m.a_to_b.transfer(colors)         # values at vertices of A, at vertices of B
    m.distortion.mean                 # 2 is an isometry

Both meshes are surfaces without handles, open or closed; defects are repaired. ``ism.map`` computes
a map (:class:`Map`), which maps points and values in both directions (:class:`Direction`).
``ism.Run`` does the same in steps. Ids are those of the given meshes, from 0. Failures are
exceptions (:class:`Error`) with a sentence and the offending ids.

Any number of threads may use a map, and one at a time a run. While the library works, other Python
threads run.

It implements: Patrick Schmidt, Janis Born, Marcel Campen, Leif Kobbelt: Distortion-Minimizing
Injective Maps Between Surfaces. ACM Transactions on Graphics 38(6), 2019.
"""

from ._library import BusyError, Error, Id, InputError, OutOfMemoryError
from ._map import Direction, Distortion, Map, Meta, Points
from ._run import Message, Run, State, Warning, map

__all__ = [
    "map",
    "Run",
    "Map",
    "Direction",
    "Points",
    "Meta",
    "Distortion",
    "State",
    "Message",
    "Error",
    "InputError",
    "BusyError",
    "OutOfMemoryError",
    "Warning",
    "Id",
]

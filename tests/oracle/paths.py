"""Single light paths from the random walk of the ray tracer.

Every ray has a number. Under any press, the ray with a given number leaves an emitter at the same point in the same
direction, so the effect of a press on one ray can be followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.scene.optical_scene import OpticalScene
from tests.oracle.scene import lower_scene
from tests.oracle.top import Presses, lower_presses
from tests.oracle.tracer import next_path
from tests.oracle.walk import FATES

TRIES_PER_PATH = 1_000_000
"""Largest number of rays tried for each requested path; if these are not enough, fewer paths are returned."""
PLACES = 200
"""Largest number of points on one path; longer paths are skipped."""


@dataclass(frozen=True, kw_only=True)
class LightPath:
    """One ray from its emitter to its end.

    Attributes
    ----------
    fate : how the ray ends: name of its class of light if it reaches a receiver, else name of the loss
        (`FATES`)
    emitter, receiver : numbers of both; the receiver is -1 if the light is lost
    ray : number of the ray
    places_mm : (n, 3) points along the path [mm]
    """

    fate: str
    emitter: int
    receiver: int
    ray: int
    places_mm: FloatArray


def sample_paths(
    scene: OpticalScene,
    centre_mm: ArrayLike,
    press: Presses,
    *,
    emitter: int,
    receiver: int | None = None,
    count: int,
    seed: int = 0,
) -> list[tuple[str, FloatArray]]:
    """How each of `count` random paths of an emitter ends (`FATES`), and its (n, 3) points [mm].

    receiver : number of the only receiver whose light counts; if None, all light counts, however it ends
    """
    walker = LightWalker(scene, centre_mm, press, seed)
    ends = None if receiver is None else [receiver]
    found = walker.random_paths(emitter, ends, count=count, most_rays=TRIES_PER_PATH * count)
    return [(path.fate, path.places_mm) for path in found]


class LightWalker:
    """The pad under one set of presses, ready to trace single rays.

    Parameters
    ----------
    scene : the pad
    centre_mm : (2,) press axis, or (tip, 2) axes if several tips press at once [mm]
    indentation : the press, None for the untouched pad, or a sequence with one of these per tip
    seed : seed of the random streams, >= 0
    """

    def __init__(self, scene: OpticalScene, centre_mm: ArrayLike, indentation: Presses, seed: int) -> None:
        self._scene = lower_scene(replace(scene, absorption_per_mm=0.0))
        (self._top,) = lower_presses(scene, np.asarray(centre_mm, dtype=np.float64)[None], [indentation])
        self._receivers, self._seed = len(scene.receiver_wall), seed

    def random_paths(
        self, emitter: int, ends: Sequence[int] | None = None, *, count: int, most_rays: int
    ) -> list[LightPath]:
        """At most `count` paths of rays from number 0 on that end at the receivers `ends`, or anywhere if None."""
        wanted = np.full(self._receivers + 1, ends is None)
        wanted[list(ends or ())] = True
        paths: list[LightPath] = []
        ray = 0
        while len(paths) < count and (path := self._next_path(emitter, ray, most_rays - ray, wanted)):
            paths.append(path)
            ray = path.ray + 1
        return paths

    def follow(self, emitter: int, rays: Sequence[int]) -> list[LightPath]:
        """Paths of the rays with given numbers; a ray that starts above the surface is left out."""
        anywhere = np.ones(self._receivers + 1, dtype=np.bool_)
        found = (self._next_path(emitter, ray, 1, anywhere) for ray in rays)
        return [path for path in found if path is not None]

    def _next_path(self, emitter: int, ray: int, tries: int, wanted: BoolArray) -> LightPath | None:
        """Path of the first of at most `tries` rays from number `ray` on that has a requested end; None if none has."""
        number, fate, receiver, places = next_path(
            self._scene, self._top, emitter, wanted, self._seed, ray, tries, PLACES
        )
        if fate < 0:
            return None
        return LightPath(fate=FATES[fate], emitter=emitter, receiver=receiver, ray=number, places_mm=places)

"""Single light paths for pictures, from the random walk of the ray tracer.

Every ray has a number. Under any press, the ray with a given number leaves an emitter at the same point in the same
direction, so the effect of a press on one ray can be followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from tests.oracle.scene import lower_scene
from tests.oracle.top import Presses, lower_presses
from tests.oracle.tracer import check_seed, next_path
from tests.oracle.walk import FATES

LOST = -1
"""Stands for a receiver's number where light reaches no receiver."""
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
        (`tests.oracle.walk.FATES`)
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
    indentation: Presses,
    *,
    emitter: int,
    receiver: int | None = None,
    count: int,
    seed: int = 0,
    field: SmoothField | None = None,
) -> list[tuple[str, FloatArray]]:
    """Random paths of one emitter's light, each with a probability in proportion to its power.

    A path that leaves the elastomer and enters it again has points in air too. A path that escapes ends at its last
    interaction. Absorption along the way is left out: the picture shows where light goes, not its power.

    Parameters
    ----------
    scene : the pad
    centre_mm, indentation, field : as for `LightWalker`
    emitter : number of the emitter
    receiver : number of the only receiver whose light counts; if None, all light counts, however it ends
    count : requested paths; fewer are returned if light that reaches the receiver is too rare
    seed : seed of the random streams, >= 0

    Returns
    -------
    for each path, how it ends (`tests.oracle.walk.FATES`) and its (n, 3) points [mm]
    """
    walker = LightWalker(scene, centre_mm, indentation, seed, field)
    if receiver is not None:
        _check_number("receiver", receiver, len(scene.receiver_wall))
    ends = None if receiver is None else (receiver,)
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
    field : height added to the top, or None; see `tests.oracle.tracer.trace_oracle`
    """

    def __init__(
        self,
        scene: OpticalScene,
        centre_mm: ArrayLike,
        indentation: Presses,
        seed: int,
        field: SmoothField | None = None,
    ) -> None:
        self._scene = lower_scene(replace(scene, absorption_per_mm=0.0))
        centres = np.asarray(centre_mm, dtype=np.float64)[None]
        (self._top,) = lower_presses(scene, centres, [indentation], [field])
        check_seed(seed)
        self._emitters, self._receivers = len(scene.emitter_wall), len(scene.receiver_wall)
        self._seed = seed

    def random_paths(
        self, emitter: int, ends: Sequence[int] | None = None, *, count: int, most_rays: int
    ) -> list[LightPath]:
        """Random paths of one emitter's light, with probabilities proportional to their power, sorted by ray number.

        Parameters
        ----------
        emitter : number of the emitter
        ends : numbers of the receivers that count, and `LOST` if light that reaches no receiver counts; if None, every
            end counts
        count : requested paths
        most_rays : largest number of rays tried; if these are not enough, fewer paths than `count` are returned
        """
        wanted = _wanted_ends(ends, self._receivers)
        paths: list[LightPath] = []
        ray = 0
        while len(paths) < count and ray < most_rays:
            path = self._next_path(emitter, ray, most_rays - ray, wanted)
            if path is None:
                break
            paths.append(path)
            ray = path.ray + 1
        return paths

    def follow(self, emitter: int, rays: Sequence[int]) -> list[LightPath]:
        """Paths of the rays with given numbers; a ray that starts above the surface is left out.

        Parameters
        ----------
        emitter : number of the emitter
        rays : numbers as in `LightPath.ray`, from any press with the same seed
        """
        anywhere = _wanted_ends(None, self._receivers)
        found = (self._next_path(emitter, ray, 1, anywhere) for ray in rays)
        return [path for path in found if path is not None]

    def _next_path(self, emitter: int, ray: int, tries: int, wanted: BoolArray) -> LightPath | None:
        """Path of the first of at most `tries` rays from number `ray` on that has a requested end; None if none has."""
        _check_number("emitter", emitter, self._emitters)
        number, fate, receiver, places = next_path(
            self._scene, self._top, emitter, wanted, self._seed, ray, tries, PLACES
        )
        if fate < 0:
            return None
        return LightPath(fate=FATES[fate], emitter=emitter, receiver=receiver, ray=number, places_mm=places)


def _wanted_ends(ends: Sequence[int] | None, receivers: int) -> BoolArray:
    """(receiver + 1,) mask of the ends that count; the last entry is for lost light."""
    wanted = np.full(receivers + 1, ends is None)
    for end in ends or ():
        if end != LOST:
            _check_number("receiver", end, receivers)
        wanted[end] = True
    return wanted


def _check_number(name: str, value: int, count: int) -> None:
    if not 0 <= value < count:
        raise InputError(f"{name}: {value} does not exist; the scene has {count}, numbered from 0")

"""Single light paths for pictures, drawn from the oracle's own walk.

A ray is named by its number: the same number leaves an emitter at the same point in the same direction
under any press, so the effect of a press on one ray can be followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import BoolArray, FloatArray
from design.errors import InputError
from sims.optics.oracle.scene import lower_scene
from sims.optics.oracle.top import Presses, lower_presses
from sims.optics.oracle.tracer import check_seed, next_path
from sims.optics.oracle.walk import FATES
from sims.optics.scene.optical_scene import OpticalScene, SmoothField

LOST = -1
"""Replaces a receiver's number for light that reaches no receiver."""
TRIES_PER_PATH = 1_000_000
"""Most rays tried for each requested path, before fewer paths are returned."""
PLACES = 200
"""Most points on one path; a longer path is skipped."""


@dataclass(frozen=True, kw_only=True)
class LightPath:
    """One ray from its emitter to its end.

    Attributes
    ----------
    fate : name of the class or of the loss, from `sims.optics.oracle.walk.FATES`
    emitter, receiver : numbers; receiver -1 where the light is lost
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

    A path that leaves the elastomer and enters it again has points in air too; one that escapes ends at its last
    interaction. Paths are drawn as without absorption: the picture shows the way of light, not its power.

    Parameters
    ----------
    centre_mm, indentation, field : as for `LightWalker`
    emitter, receiver : numbers; with a receiver only paths that end on it, without any fate
    count : requested paths; fewer are returned where light that reaches the receiver is too rare
    seed : seed of the random streams, >= 0

    Returns
    -------
    name of the class or fate (`sims.optics.oracle.walk.FATES`), and (n, 3) points along the path [mm]
    """
    walker = LightWalker(scene, centre_mm, indentation, seed, field)
    if receiver is not None:
        _check_number("receiver", receiver, len(scene.receiver_wall))
    ends = None if receiver is None else (receiver,)
    found = walker.random_paths(emitter, ends, count=count, most_rays=TRIES_PER_PATH * count)
    return [(path.fate, path.places_mm) for path in found]


class LightWalker:
    """A scene in one state, ready to walk single rays.

    Parameters
    ----------
    centre_mm : (2,) press axis, or (tip, 2) axes where several tips press at once [mm]
    indentation : the press, None where untouched, or a sequence of these, one per tip
    seed : seed of the random streams, >= 0
    field : height added to the top, or None; as for `sims.optics.oracle.tracer.trace_oracle`
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
        """Random paths of one emitter's light in the order of the rays, with probabilities proportional to their power.

        Parameters
        ----------
        ends : receivers that count, and `LOST` for all light that reaches no receiver; None: every end
        most_rays : rays tried in all, before fewer paths than `count` are returned
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
        """Paths of rays of given numbers; a ray that starts above the surface is left out.

        Parameters
        ----------
        rays : numbers, as in `LightPath.ray`, found with the same seed under any press
        """
        anywhere = _wanted_ends(None, self._receivers)
        found = (self._next_path(emitter, ray, 1, anywhere) for ray in rays)
        return [path for path in found if path is not None]

    def _next_path(self, emitter: int, ray: int, tries: int, wanted: BoolArray) -> LightPath | None:
        """The next ray from a number on that has a requested end."""
        _check_number("emitter", emitter, self._emitters)
        number, fate, receiver, places = next_path(
            self._scene, self._top, emitter, wanted, self._seed, ray, tries, PLACES
        )
        if fate < 0:
            return None
        return LightPath(fate=FATES[fate], emitter=emitter, receiver=receiver, ray=number, places_mm=places)


def _wanted_ends(ends: Sequence[int] | None, receivers: int) -> BoolArray:
    """(receiver + 1,) which ends count; the last for lost light."""
    wanted = np.full(receivers + 1, ends is None)
    for end in ends or ():
        if end != LOST:
            _check_number("receiver", end, receivers)
        wanted[end] = True
    return wanted


def _check_number(name: str, value: int, count: int) -> None:
    if not 0 <= value < count:
        raise InputError(f"{name}: {value} does not exist; the scene has {count}, numbered from 0")

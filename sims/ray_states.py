"""Sample paths of some pairs' light, untouched and under presses, with the power that each kind carries.

Two models, each for what it is good at: the paths are walks of the ray tracer (`sims.optics.paths`), at random;
the powers are integrals of the light model (`sims.optics.trace`), which a few dozen paths could never give.
The classes of both agree but for the border between `top` and `skirt`, which are one kind here.

Paths of a kind are each as likely as the power that they carry. How many are drawn of a kind grows with the square
root of its power, so that weak kinds are still seen and strong ones do not hide them; at least a few. Light lost
under a press is found by following the rays that arrived while the pad was untouched, so it is a sample of what
the press takes away. Left out: absorption along the drawn paths, and kinds so rare that no ray of the search
shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from design.spec import SensorDesign
from sims.indentation import Indentation
from sims.light_kinds import kind_of
from sims.optics.engine import Accuracy
from sims.optics.light_signals import LightSignals
from sims.optics.lower import scene_of
from sims.optics.paths import LOST, LightPath, LightWalker
from sims.optics.tracing import trace

FloatArray = NDArray[np.float64]
T = TypeVar("T")
Pair = tuple[int, int]
Press = tuple[float, float, float]

POOL_PER_PATH = 20
"""Paths found for each one drawn, so that a kind with a hundredth of the power is still there."""
FEWEST = 5
"""Paths drawn of a kind however weak it is, where as many were found."""
MOST_RAYS = 2_000_000
"""Rays tried for an emitter under one press: 1 to 3 s."""


@dataclass(frozen=True, kw_only=True)
class RayState:
    """Light of the chosen pairs under one press.

    Attributes
    ----------
    press_mm : x, y, depth [mm]; depth 0 is untouched
    indentation : the deformed surface; None where untouched
    power : (pair,) by path class, over the power of the pair's emitter [-]
    emitters : number of emitters that the pairs have together
    paths : light that arrives, the more of a kind the more power it has
    lost : light that does not: under a press, rays that arrived while it was untouched
    lost_by : for each of the lost, the receiver that it reached while untouched, or `LOST`
    """

    press_mm: Press
    indentation: Indentation | None
    power: dict[str, FloatArray]
    emitters: int
    paths: tuple[LightPath, ...]
    lost: tuple[LightPath, ...]
    lost_by: tuple[int, ...]

    @property
    def power_by_kind(self) -> dict[str, float]:
        """Power of all pairs together by the key of its kind, over that of their emitters together [-]."""
        found: dict[str, float] = {}
        for name, values in self.power.items():
            key = kind_of(name).key
            found[key] = found.get(key, 0.0) + float(values.sum()) / self.emitters
        return found

    @property
    def total(self) -> float:
        """Power of all pairs and kinds together, over that of their emitters together [-]."""
        return sum(self.power_by_kind.values())


@dataclass(frozen=True, kw_only=True)
class RayChoice:
    """Which light is looked at, and how many paths of it.

    Attributes
    ----------
    pairs : emitter and receiver numbers
    count : paths drawn of the strongest kind
    shows_all_losses : draw any light that no receiver of the pairs gets, in place of what the press takes away
    pool_per_path : paths looked for, over those drawn
    most_rays : rays tried for an emitter under one press
    accuracy : of the light model
    seed : of all random streams
    """

    pairs: tuple[Pair, ...]
    count: int
    shows_all_losses: bool = False
    pool_per_path: int = POOL_PER_PATH
    most_rays: int = MOST_RAYS
    accuracy: str | Accuracy = "standard"
    seed: int = 0

    @property
    def receivers(self) -> dict[int, tuple[int, ...]]:
        """Receivers of each emitter."""
        emitters = dict.fromkeys(emitter for emitter, _ in self.pairs)
        return {one: tuple(r for emitter, r in self.pairs if emitter == one) for one in emitters}


def ray_states(
    design: SensorDesign,
    choice: RayChoice,
    presses: Sequence[Press],
    on_step: Callable[[float], None] | None = None,
) -> tuple[RayState, ...]:
    """Find paths and powers, untouched first and then under each press.

    Parameters
    ----------
    presses : x, y, depth > 0 [mm]
    on_step : called with the share that is done

    Raises
    ------
    InputError, ModelScopeError : a press that contact or light model refuses
    """
    from sims.contact import indent

    rows = [(design.cavity.length_mm / 2, design.cavity.width_mm / 2, 0.0), *presses]
    light = _light(design, choice, rows)
    scene = scene_of(design)
    untouched: dict[int, list[LightPath]] = {}
    states: list[RayState] = []
    for number, row in enumerate(rows):
        press = indent(design, row[2]) if number else None
        walker = LightWalker(scene, row[:2], press, choice.seed)
        search = _Search(
            walker=walker, choice=choice, is_pressed=press is not None, receivers=len(scene.receiver_wall)
        )
        pools = {emitter: search.arriving(emitter) for emitter in choice.receivers}
        untouched = untouched or pools
        lost = search.lost(untouched)
        state = RayState(
            press_mm=row,
            indentation=press,
            power=_power(light, number, choice.pairs),
            emitters=len(choice.receivers),
            paths=(),
            lost=tuple(path for path, _ in lost),
            lost_by=tuple(receiver for _, receiver in lost),
        )
        brightest = max((states or [state])[0].power_by_kind.values())
        states.append(replace(state, paths=_drawn(pools, _numbers(state, brightest, choice.count))))
        if on_step is not None:
            on_step((number + 1) / len(rows))
    return tuple(states)


def _light(design: SensorDesign, choice: RayChoice, rows: Sequence[Press]) -> LightSignals:
    scene = scene_of(design)
    mask = np.zeros((len(scene.emitter_wall), len(scene.receiver_wall)), dtype=np.bool_)
    mask[tuple(np.array(choice.pairs).T)] = True
    return trace(design, np.array(rows), accuracy=choice.accuracy, seed=choice.seed, pairs=mask)


def _power(light: LightSignals, state: int, pairs: tuple[Pair, ...]) -> dict[str, FloatArray]:
    emitters, receivers = np.array(pairs).T
    return {name: flux[state, emitters, receivers] for name, flux in light.by_class.items()}


@dataclass(frozen=True, kw_only=True)
class _Search:
    """Looks for paths under one press."""

    walker: LightWalker
    choice: RayChoice
    is_pressed: bool
    receivers: int

    def arriving(self, emitter: int) -> list[LightPath]:
        """Light of an emitter that its receivers get, in the order of the rays."""
        choice = self.choice
        wanted = max(1, round(choice.count * choice.pool_per_path / len(choice.receivers)))
        ends = choice.receivers[emitter]
        return self.walker.random_paths(emitter, ends, count=wanted, most_rays=choice.most_rays)

    def lost(self, untouched: dict[int, list[LightPath]]) -> tuple[tuple[LightPath, int], ...]:
        """Light that does not arrive, and where it arrived while untouched."""
        if self.choice.shows_all_losses:
            pools = {emitter: self._anything_lost(emitter) for emitter in self.choice.receivers}
            return _in_turn(pools, self.choice.count)
        if not self.is_pressed:
            return ()
        pools = {emitter: self._missing(emitter, former) for emitter, former in untouched.items()}
        share = sum(map(len, pools.values())) / max(1, sum(map(len, untouched.values())))
        return _in_turn(pools, _number(share, self.choice.count))

    def _anything_lost(self, emitter: int) -> list[tuple[LightPath, int]]:
        ends = [LOST, *sorted(set(range(self.receivers)) - set(self.choice.receivers[emitter]))]
        choice = self.choice
        found = self.walker.random_paths(emitter, ends, count=choice.count, most_rays=choice.most_rays)
        return [(path, LOST) for path in found]

    def _missing(self, emitter: int, former: list[LightPath]) -> list[tuple[LightPath, int]]:
        receivers = {path.ray: path.receiver for path in former}
        now = self.walker.follow(emitter, list(receivers))
        wanted = self.choice.receivers[emitter]
        return [(path, receivers[path.ray]) for path in now if path.receiver not in wanted]


def _numbers(state: RayState, brightest: float, count: int) -> dict[str, int]:
    """How many paths of each kind are drawn: `count` for one as bright as the brightest while untouched."""
    shares = {
        key: power / brightest if brightest > 0.0 else 1.0 for key, power in state.power_by_kind.items()
    }
    return {key: _number(share, count) for key, share in shares.items()}


def _number(share: float, count: int) -> int:
    return min(count, max(FEWEST, round(count * float(np.sqrt(max(share, 0.0))))))


def _drawn(pools: dict[int, list[LightPath]], numbers: dict[str, int]) -> tuple[LightPath, ...]:
    """So many paths of each kind, where as many were found, the emitters in turn."""
    by_kind: dict[str, dict[int, list[LightPath]]] = {}
    for emitter, pool in pools.items():
        for path in pool:
            by_kind.setdefault(kind_of(path.fate).key, {}).setdefault(emitter, []).append(path)
    return tuple(path for key, pool in by_kind.items() for path in _in_turn(pool, numbers.get(key, FEWEST)))


def _in_turn(pools: dict[int, list[T]], count: int) -> tuple[T, ...]:
    """The first paths of every pool, one after the other, up to a count."""
    ranked = sorted(
        ((rank, emitter) for emitter, pool in pools.items() for rank in range(len(pool))),
    )
    return tuple(pools[emitter][rank] for rank, emitter in ranked[:count])

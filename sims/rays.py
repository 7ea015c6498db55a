"""Sample light paths for display: kinds of light, with their modes and colours, and the power of each kind.

The light models distinguish more path classes and losses than a picture can show. The table `KINDS` groups those that
are drawn alike into kinds of light. A class that is not in the table is drawn as `other`, under its own name. Colours
are those of the signal plots (Okabe and Ito 2008), and pale versions of them for a dark background. Dashes and marks
differ too, so that nothing depends on colour alone.

Paths are random walks (`optopad.sims.optics.paths`). Powers are integrals of the light model
(`optopad.sims.optics.tracing`), because a few dozen paths are too few to compute them. Powers are those of the whole
pressed surface. Paths are drawn on the axisymmetric surface around the press axis, without the effect of walls, which
is a few tenths of a millimetre near them. Both classify light alike.

Within a kind, a path is drawn with a probability proportional to its power. The number of paths drawn of a kind is at
least a few and grows with the square root of its power. So weak kinds are visible, and strong ones do not hide them. To
find the light lost under a press, rays that arrived while the pad was untouched are followed again. Left out:
absorption along the drawn paths, and kinds so rare that the search finds no ray.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.optics.engine.trace_states import Accuracy
from optopad.sims.optics.paths import LOST as NO_RECEIVER
from optopad.sims.optics.paths import LightPath, LightWalker
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.tracing import trace
from optopad.sims.press import Indentation

Mark = Literal["none", "mirror", "scatter", "end"]


@dataclass(frozen=True, kw_only=True)
class LightKind:
    """A kind of light: one or more path classes or losses that are drawn alike.

    Attributes
    ----------
    key : short name, used in files and in the page
    title : name in a legend
    words : description, to be used within a sentence
    mode : 1, 2, or None for light that is part of neither mode
    classes : names of path classes and losses of the light models
    colour, night_colour : colour on a light and on a dark background
    dash : alternating lengths of strokes and gaps, in line widths; empty for a solid line
    mark : points of a path that are marked: where it is mirrored or scattered, its end, or none
    """

    key: str
    title: str
    words: str
    mode: int | None
    classes: tuple[str, ...]
    colour: str
    night_colour: str
    dash: tuple[float, ...]
    mark: Mark


DIRECT = LightKind(
    key="direct",
    title="mode 2: direct",
    words="straight from emitter to receiver, until the dimple or the tip blocks it",
    mode=2,
    classes=("direct",),
    colour="#0072b2",
    night_colour="#5cb8f0",
    dash=(),
    mark="none",
)
MIRRORED = LightKind(
    key="top",
    title="mode 1: mirrored by the top",
    words="mirrored by the top; a press tilts the mirror",
    mode=1,
    classes=("top", "skirt"),
    colour="#c24e00",
    night_colour="#ff9f5f",
    dash=(),
    mark="mirror",
)
WALL = LightKind(
    key="wall",
    title="mirrored by a wall",
    words="mirrored by a smooth wall at least once, never scattered",
    mode=None,
    classes=("wall",),
    colour="#93387a",
    night_colour="#eb9fd2",
    dash=(7.0, 2.0),
    mark="mirror",
)
CROSSING = LightKind(
    key="crossing",
    title="across the crater",
    words="left through the top and re-entered across the crater",
    mode=None,
    classes=("crossing",),
    colour="#7a5c00",
    night_colour="#e3c75a",
    dash=(4.0, 1.5, 1.0, 1.5),
    mark="mirror",
)
SCATTERED = LightKind(
    key="diffuse",
    title="scattered",
    words="scattered at least once by a wall, the bottom or the tip",
    mode=None,
    classes=("diffuse",),
    colour="#00785a",
    night_colour="#57cfa9",
    dash=(5.0, 1.5, 1.0, 1.5),
    mark="scatter",
)
LOST = LightKind(
    key="lost",
    title="lost",
    words="absorbed by walls, bottom or tip, or lost through the top",
    mode=None,
    classes=("walls", "bottom", "tip", "escaped", "uncounted", "skin"),
    colour="#5b6470",
    night_colour="#98a1ac",
    dash=(1.0, 2.0),
    mark="end",
)
KINDS = (DIRECT, MIRRORED, WALL, CROSSING, SCATTERED, LOST)
"""All kinds, in the order of a legend; `LOST` last."""

_BY_CLASS = {name: kind for kind in KINDS for name in kind.classes}


def kind_of(class_name: str) -> LightKind:
    """The kind of light to which a path class or loss belongs; a class that belongs to none gets one of its own."""
    if class_name in _BY_CLASS:
        return _BY_CLASS[class_name]
    return LightKind(
        key="other",
        title=f"other: {class_name}",
        words=f"the light model's class {class_name!r}",
        mode=None,
        classes=(class_name,),
        colour="#444c57",
        night_colour="#c3cad2",
        dash=(3.0, 1.0),
        mark="none",
    )


Pair = tuple[int, int]
Press = tuple[float, float, float]

POOL_PER_PATH = 20
"""Number of paths searched for each drawn path, so that a kind with a hundredth of the power is still found."""
FEWEST = 5
"""Smallest number of paths drawn of a kind of light, if that many were found."""
MOST_RAYS = 2_000_000
"""Largest number of rays tried for an emitter under one press; they take a second or two."""


@dataclass(frozen=True, kw_only=True)
class RayState:
    """Light of the chosen pairs under one press.

    Attributes
    ----------
    press_mm : x, y, depth [mm]; depth 0 is untouched
    indentation : the deformed surface around the axis; None where untouched
    power : for each path class by name, (pair,) power received by each pair, as a share of its emitter's power [-]
    emitters : number of different emitters in the pairs
    paths : drawn paths that reach a receiver of the pairs; kinds of light with more power have more paths
    lost : drawn paths that miss these receivers; unless `RayChoice.shows_all_losses`, only those of rays that reached
        them before the press
    lost_by : for each lost path, the receiver that its ray reached before the press, or `NO_RECEIVER`
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
        """Power that all pairs together receive as each kind of light, as a share of their emitters' total power [-].

        The dictionary is keyed by `LightKind.key`.
        """
        everything = list(range(len(next(iter(self.power.values())))))
        return {key: value / self.emitters for key, value in self.sums_by_kind(everything).items()}

    def sums_by_kind(self, pairs: list[int]) -> dict[str, float]:
        """Power that the given pairs together receive as each kind of light, as a share of one emitter's power [-].

        The dictionary is keyed by `LightKind.key`.

        pairs : indices of the pairs in the arrays of `power`
        """
        found: dict[str, float] = {}
        for name, values in self.power.items():
            key = kind_of(name).key
            found[key] = found.get(key, 0.0) + float(values[pairs].sum())
        return found

    @property
    def total(self) -> float:
        """Power that all pairs together receive, as a share of their emitters' total power [-]."""
        return sum(self.power_by_kind.values())


@dataclass(frozen=True, kw_only=True)
class RayChoice:
    """Which light to show, and with how many paths.

    Attributes
    ----------
    pairs : emitter and receiver number of each pair
    count : number of paths drawn of the strongest kind of light in the untouched pad
    draws_each_pair : if True, `count` applies to each pair separately; if False, to all pairs together
    shows_all_losses : whether to draw all light that misses the pairs' receivers; if False, only light that the press
        takes away from them
    pool_per_path : number of paths searched for each drawn path
    most_rays : largest number of rays tried for an emitter under one press
    accuracy : settings of the light model
    seed : seed of all random streams
    """

    pairs: tuple[Pair, ...]
    count: int
    draws_each_pair: bool = False
    shows_all_losses: bool = False
    pool_per_path: int = POOL_PER_PATH
    most_rays: int = MOST_RAYS
    accuracy: str | Accuracy = "standard"
    seed: int = 0

    @property
    def receivers(self) -> dict[int, tuple[int, ...]]:
        """For each emitter, the receivers of its pairs."""
        emitters = dict.fromkeys(emitter for emitter, _ in self.pairs)
        return {one: tuple(r for emitter, r in self.pairs if emitter == one) for one in emitters}

    @property
    def groups(self) -> list[list[int]]:
        """Pairs whose light is drawn together, as lists of indices in `pairs`."""
        everything = list(range(len(self.pairs)))
        return [[number] for number in everything] if self.draws_each_pair else [everything]


@dataclass(frozen=True, kw_only=True)
class _Found:
    """A path and its pair. For lost light, it is the pair whose receiver the ray reached in the untouched pad."""

    pair: Pair
    path: LightPath


def ray_states(
    design: SensorDesign,
    choice: RayChoice,
    presses: Sequence[Press],
    on_step: Callable[[float], None] | None = None,
) -> tuple[RayState, ...]:
    """Paths and powers of the chosen light: first in the untouched pad, then under each press.

    Parameters
    ----------
    design : the sensor
    choice : the light to show
    presses : x, y, depth > 0 of each press [mm]
    on_step : function that is called with the share of the work done, 0 to 1

    Raises
    ------
    InputError, ModelScopeError : the contact or light model refuses a press.
    """
    from optopad.sims.contact import indent

    rows = [(design.cavity.length_mm / 2, design.cavity.width_mm / 2, 0.0), *presses]
    light = _light(design, choice, rows)
    scene = scene_of(design)
    before: list[_Found] = []
    states: list[RayState] = []
    for number, row in enumerate(rows):
        press = indent(design, row[2], row[:2]) if number else None
        search = _Search(walker=LightWalker(scene, row[:2], press, choice.seed), choice=choice)
        state = RayState(
            press_mm=row,
            indentation=press,
            power=_power(light, number, choice.pairs),
            emitters=len(choice.receivers),
            paths=(),
            lost=(),
            lost_by=(),
        )
        arriving = search.arriving()
        before = before if number else arriving
        lost = (
            search.anything_lost(len(scene.receiver_wall))
            if choice.shows_all_losses
            else search.missing(before)
        )
        states.append(_filled(state, (states or [state])[0], choice, arriving, before, lost))
        if on_step is not None:
            on_step((number + 1) / len(rows))
    return tuple(states)


def _light(design: SensorDesign, choice: RayChoice, rows: Sequence[Press]) -> LightSignals:
    scene = scene_of(design)
    mask = np.zeros((len(scene.emitter_wall), len(scene.receiver_wall)), dtype=np.bool_)
    mask[tuple(np.array(choice.pairs).T)] = True
    return trace(Draft.of(design), np.array(rows), accuracy=choice.accuracy, seed=choice.seed, pairs=mask)


def _power(light: LightSignals, state: int, pairs: tuple[Pair, ...]) -> dict[str, FloatArray]:
    emitters, receivers = np.array(pairs).T
    return {name: flux[state, emitters, receivers] for name, flux in light.by_class.items()}


@dataclass(frozen=True, kw_only=True)
class _Search:
    """Search for light paths of the chosen pairs under one press."""

    walker: LightWalker
    choice: RayChoice

    def arriving(self) -> list[_Found]:
        """Find paths that reach a receiver of the pairs."""
        choice = self.choice
        together = len(choice.pairs) if choice.draws_each_pair else 1
        wanted = max(1, round(choice.count * choice.pool_per_path * together / len(choice.receivers)))
        return [
            _Found(pair=(emitter, path.receiver), path=path)
            for emitter, ends in choice.receivers.items()
            for path in self.walker.random_paths(emitter, ends, count=wanted, most_rays=choice.most_rays)
        ]

    def anything_lost(self, receivers: int) -> list[_Found]:
        """Find paths that reach no receiver of the pairs; `receivers` is the number of all receivers of the pad."""
        choice, found = self.choice, []
        for emitter, own in choice.receivers.items():
            ends = [NO_RECEIVER, *sorted(set(range(receivers)) - set(own))]
            paths = self.walker.random_paths(emitter, ends, count=choice.count, most_rays=choice.most_rays)
            found += [_Found(pair=(emitter, NO_RECEIVER), path=path) for path in paths]
        return found

    def missing(self, before: list[_Found]) -> list[_Found]:
        """Follow rays found in the untouched pad (`before`); return those that no longer reach the pairs' receivers."""
        found = []
        for emitter, own in self.choice.receivers.items():
            former = {one.path.ray: one.pair for one in before if one.pair[0] == emitter}
            now = self.walker.follow(emitter, list(former))
            found += [_Found(pair=former[path.ray], path=path) for path in now if path.receiver not in own]
        return found


def _filled(
    state: RayState,
    untouched: RayState,
    choice: RayChoice,
    arriving: list[_Found],
    before: list[_Found],
    lost: list[_Found],
) -> RayState:
    """Copy of `state` with the paths to draw, which are selected from those found."""
    drawn: list[_Found] = []
    gone: list[_Found] = []
    for group in choice.groups:
        pairs = {choice.pairs[number] for number in group}
        mine, former = _of(pairs, arriving), _of(pairs, before)
        brightest = max(untouched.sums_by_kind(group).values())
        powers = state.sums_by_kind(group)
        for key in dict.fromkeys(kind_of(one.path.fate).key for one in mine):
            share = powers.get(key, 0.0) / brightest if brightest > 0.0 else 1.0
            same = [one for one in mine if kind_of(one.path.fate).key == key]
            drawn += _in_turn(same, _number(share, choice.count))
        if not choice.shows_all_losses:
            away = _of(pairs, lost)
            gone += _in_turn(away, _number(len(away) / max(1, len(former)), choice.count))
    if choice.shows_all_losses:
        gone = _in_turn(lost, choice.count)
    return replace(
        state,
        paths=tuple(one.path for one in drawn),
        lost=tuple(one.path for one in gone),
        lost_by=tuple(one.pair[1] for one in gone),
    )


def _of(pairs: set[Pair], found: list[_Found]) -> list[_Found]:
    return [one for one in found if one.pair in pairs]


def _number(share: float, count: int) -> int:
    """Number of paths to draw of a kind of light.

    share : power of the kind over that of the brightest kind in the untouched pad [-]
    count : number of paths drawn of that brightest kind
    """
    return min(count, max(FEWEST, round(count * float(np.sqrt(max(share, 0.0))))))


def _in_turn(found: list[_Found], count: int) -> list[_Found]:
    """Select up to `count` paths, one from each emitter in turn."""
    seen: dict[int, int] = {}
    ranks = []
    for place, one in enumerate(found):
        seen[one.pair[0]] = rank = seen.get(one.pair[0], -1) + 1
        ranks.append((rank, place))
    return [found[place] for _, place in sorted(ranks)[:count]]

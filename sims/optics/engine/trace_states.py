"""Trace every pair of a scene through pressed tops: flux by path class, with a standard error.

Model
-----
Geometric optics in a block of one refractive index whose top is the deformed surface, with unpolarised Fresnel
reflection and total reflection. Absorption follows Beer and Lambert along every path. The tip in contact absorbs or
scatters. Walls and bottom scatter; if the scene gives a refractive index behind the walls, they also mirror their
Fresnel share. Receivers' faces absorb. Emitters follow a Lambertian order or an angular table, receivers a response
table. Light that leaves through the top is lost.

Path classes
------------
- `direct`: straight light, possibly in part hidden by the dimple.
- `top`: mirrored by the top only, each time outside the skirt radius, the outermost radius where the tip's curve is
  steeper than 0.1.
- `skirt`: as `top`, but at least once inside the skirt radius.
- `wall`: mirrored by a wall at least once and never scattered.
- `diffuse`: scattered at least once.

Method, class by class
----------------------
- Direct light is integrated by quadrature with an analytic horizon (`straight`).
- Light mirrored once is integrated image by image (`images`): path by path if possible, else over points of the top
  with the lit area of the emitter cut exactly (`mirrored.pinhole`).
- Light mirrored several times is traced by three rays per point of the top, in cells that are divided where such light
passes (`repeated`).
- Scattered light is that of the untouched pad times a ratio of two radiosity sums over patches of walls and bottom,
with and without the press. The press's change of the light on patches is found by rays to a grid on the pressed top;
the grid is finer near each emitter and receiver, and faint rays are followed at random (`scattered`).
- Light between smooth walls is traced by the same rays with and without the press.

Standard error
--------------
Replicates with other offsets give the standard error (`stated_error`). It covers grids and rays, direct light that is
partly hidden, and the usual error of the Gauss rules (0.01 % of the untouched flux). It does not cover images narrower
than the cells that search for them, the patch size, more than 24 reflections, light that the tip scatters twice, and
light scattered more than once that the dimple obstructs. With a tip of 30 % reflectance between walls of 40 % this
obstruction has no measurable effect to a depth of 3 mm; deeper than the tip's radius it is 0.8 % of the scattered
light. Light mirrored several times is sampled for the requested pairs, so a pair mask changes it, within this error.
All other light stays the same to the bit.

Reuse
-----
A pair whose straight lines miss every deformed part keeps its untouched value. Of presses that are symmetric to each
other only one is traced (`scene.symmetry`). One emitter's light in one state depends on no other emitter or state, so
it can be stored as a row and used again (`light_rows`).

The model leaves out roughness and haze, polarisation, light that leaves the top and enters it again across the crater
(measured in docs/validation/crossing.md), and sockets and component bodies behind the walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.optics.accuracy import ACCURACIES, LADDER, Accuracy, accuracy_of, checked_target
from optopad.sims.optics.engine.general.lower import FormedStack, check_formed, stack_formed
from optopad.sims.optics.engine.general.trace import trace_formed
from optopad.sims.optics.engine.light_rows import (
    KeptRows,
    content_of,
    name_of_names,
    names_of,
    row_names,
    row_of,
)
from optopad.sims.optics.engine.stated_error import standard_error
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.optics.engine.untouched import Untouched, gauss, straight_rules, untouched_pad
from optopad.sims.optics.scene.lower import block_form, check_scene, wanted_pairs
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from optopad.sims.optics.scene.symmetry import StateClasses, each_its_own, press_keys, state_classes
from optopad.sims.optics.surface.tops import TopStack, stack_tops
from optopad.sims.press import GridTop, Indentation

__all__ = ["ACCURACIES", "CLASS_NAMES", "Accuracy", "RawLight", "trace_scene"]

CLASS_NAMES = ("direct", "top", "skirt", "wall", "diffuse")
States = Sequence[Indentation | GridTop | None]
BATCH_STATES, BATCH_GRIDS = 32, 8
"""Number of states that are traced together, and whose rows are then stored; and of those on grids of `GridTops`."""
OF_CLASSES = slice(0, len(CLASS_NAMES))
ERROR, SCALE, CHANGE_ERROR = range(len(CLASS_NAMES), len(CLASS_NAMES) + 3)
ROW = len(CLASS_NAMES) + 3
"""Number of lines of a row of light. Each line has a number per receiver: flux of each class, standard error, untouched
flux (above 0), and the part of the error that differs from state to state."""


@dataclass(frozen=True, kw_only=True)
class RawLight:
    """Flux as a fraction of emitted power, with its errors.

    Attributes
    ----------
    flux : (class, state, emitter, receiver) flux, classes in the order of `CLASS_NAMES` [-]
    standard_error : (state, emitter, receiver) standard error of the flux summed over classes [-]
    change_error : (state, emitter, receiver) part of the standard error that differs from state to state [-]
    relative_error : (state,) root mean square, over the requested pairs, of the ratio of standard error to untouched
        flux [-]
    is_met : (state,) whether `relative_error` is within the required error; True if no error was required
    """

    flux: FloatArray
    standard_error: FloatArray
    change_error: FloatArray
    relative_error: FloatArray
    is_met: BoolArray


def trace_scene(
    scene: OpticalScene,
    centres_mm: FloatArray,
    indentations: States,
    *,
    fields: Sequence[SmoothField | None] | None = None,
    classes: StateClasses | None = None,
    accuracy: str | float | Accuracy = "standard",
    seed: int = 0,
    pairs: BoolArray | None = None,
    on_step: Callable[[int, int], None] | None = None,
    kept: KeptRows | None = None,
) -> RawLight:
    """Trace a scene for a list of states, each the untouched pad or a press.

    Parameters
    ----------
    scene : walls, emitters, receivers and materials
    centres_mm : (state, 2) press axes; ignored for an untouched state [mm]
    indentations : for each state one press, None (untouched), or the whole top as a grid. If one state has a grid, all
        are traced by the method for discs and crowns
    fields : for each state a smooth height added to the top, or None; if omitted, no state has a field
    classes : groups of states of equal light. If given, centres, indentations and fields have one entry per group
    accuracy : name (draft, score, standard, fine or reference), settings, or a required relative error. If an error is
        given, settings are refined, up to reference, for the states that miss it (`RawLight.relative_error`, `is_met`)
    seed : seed of all offsets; the same seed gives identical results for any number of threads
    pairs : (emitter, receiver) or (state, emitter, receiver) mask of the pairs to trace; the flux of others is 0
    on_step : function called with (states done, states)
    kept : store of rows. If given, stored rows are read, and others are traced and stored; if None, all are traced

    Raises
    ------
    InputError, ModelScopeError : see `optopad.sims.optics.scene.lower`, `optopad.sims.optics.surface.curves` and
        `optopad.sims.optics.surface.tops`.
    """
    check_scene(scene)
    centres = np.asarray(centres_mm, dtype=np.float64)
    if scene.form is None and any(isinstance(one, GridTop) for one in indentations):
        scene = replace(scene, form=block_form(scene))
    if scene.form is not None:
        check_formed(scene, fields)
    if classes is None:
        classes = _classes(scene, centres, indentations, fields)
        centres, indentations = centres[classes.first], [indentations[state] for state in classes.first]
        fields = None if fields is None else [fields[state] for state in classes.first]
    tops = Tops(scene, lambda: (centres, indentations, fields))
    return trace_tops(tops, classes, accuracy=accuracy, seed=seed, pairs=pairs, on_step=on_step, kept=kept)


@dataclass(frozen=True)
class Tops:
    """Tops of groups of equal states, converted to arrays when they are first needed.

    Attributes
    ----------
    scene : the scene of the tops
    made : function that returns centres, indentations and fields of the groups, as `trace_scene` takes them
    source : bytes that identify the inputs; the same bytes give the same tops. If None, tops are identified by content
    """

    scene: OpticalScene
    made: Callable[[], tuple[FloatArray, States, Sequence[SmoothField | None] | None]]
    source: bytes | None = None

    @cached_property
    def stack(self) -> TopStack | FormedStack:
        """The tops as arrays that kernels read."""
        centres, indentations, fields = self.made()
        if self.scene.form is None:
            return stack_tops(_curves(indentations), centres, self.scene, fields)
        check_formed(self.scene, fields)
        return stack_formed(self.scene, centres, indentations, fields)

    def some(self, groups: IntArray) -> tuple[TopStack | FormedStack, IntArray]:
        """Arrays with the tops of some groups, and the numbers of these groups there."""
        return self.stack, groups

    def names(
        self, groups: IntArray, asked: BoolArray, settings: Accuracy, seed: int, kept: KeptRows
    ) -> list[list[bytes]]:
        """Names of rows by group and emitter: from the store if they are there, else computed from the tops."""
        if self.source is None:
            return row_names(self.scene, self.stack, groups, asked, settings, seed)
        name = name_of_names(self.source + groups.tobytes(), asked, settings, seed)
        names = names_of(kept.read([name]).get(name), *asked.shape[:2])
        if names is None:
            names = row_names(self.scene, self.stack, groups, asked, settings, seed)
            kept.write({name: b"".join(b"".join(of_state) for of_state in names)})
        return names


class Inputs(NamedTuple):
    """What determines the tops of groups of states; it names their light in place of the tops.

    Attributes
    ----------
    rows : (group, tip, 3) x, y, depth of each tip [mm]
    field : for each group, bytes that identify all other inputs
    """

    rows: FloatArray
    field: Sequence[FloatArray]


@dataclass(frozen=True, kw_only=True)
class GridTops:
    """Tops of groups of equal states on grids. They take much memory, so each is made only for its trace.

    Attributes
    ----------
    scene : the scene of the tops
    inputs : what determines each top; the same values give the same top
    made : function that returns the top of the group with a given number; None if untouched. Threads call it
    """

    scene: OpticalScene
    inputs: Inputs
    made: Callable[[int], GridTop | None]

    def some(self, groups: IntArray) -> tuple[FormedStack, IntArray]:
        """Arrays with the tops of some groups, newly made, and the numbers of these groups there."""
        found: list[GridTop | None] = [None] * len(groups)

        def make(number: int) -> None:
            found[number] = self.made(int(groups[number]))

        run_each(make, len(groups))
        return stack_formed(self.scene, np.zeros((len(groups), 2)), found), np.arange(len(groups))

    def names(
        self, groups: IntArray, asked: BoolArray, settings: Accuracy, seed: int, _kept: KeptRows
    ) -> list[list[bytes]]:
        """Names of rows by group and emitter."""
        return row_names(self.scene, self.inputs, groups, asked, settings, seed)


def trace_tops(
    tops: Tops | GridTops,
    classes: StateClasses,
    *,
    accuracy: str | float | Accuracy = "standard",
    seed: int = 0,
    pairs: BoolArray | None = None,
    on_step: Callable[[int, int], None] | None = None,
    kept: KeptRows | None = None,
) -> RawLight:
    """Trace the tops of groups of equal states; parameters, result and errors are those of `trace_scene`."""
    scene = tops.scene
    check_scene(scene)
    states = len(classes.member)
    wanted = wanted_pairs(pairs, states, len(scene.emitter_wall), len(scene.receiver_wall))
    if isinstance(tops, Tops) and (kept is None or tops.source is None):
        tops.stack  # noqa: B018 (refuses tops that cannot be lowered, before any light)
    asked = _class_pairs(wanted, classes)
    if isinstance(accuracy, (str, Accuracy)):
        target, ladder = np.inf, [accuracy_of(accuracy, 2 if scene.form is None else 1)]
    else:
        target, ladder = checked_target(accuracy), list(LADDER)
    rows = np.zeros((*asked.shape[:2], ROW, asked.shape[2]))
    relative = np.full(len(classes.first), np.inf)
    for settings in ladder:
        left = np.flatnonzero(relative > target) if np.isfinite(target) else np.arange(len(classes.first))
        if left.size == 0:
            break
        work = _Work(
            tops=tops,
            states=left,
            asked=asked[left],
            settings=settings,
            seed=seed,
        )
        rows[left] = _rows_of(work, kept, _as_share_of_states(on_step, len(classes.first), states))
        relative[left] = _pooled(rows[left, :, ERROR] / rows[left, :, SCALE], asked[left])
    member, there = (
        classes.member[:, None, None],
        (classes.emitters[:, :, None], classes.receivers[:, None, :]),
    )
    lines = rows.transpose(2, 0, 1, 3)
    return RawLight(
        flux=np.where(wanted, lines[OF_CLASSES][:, member, *there], 0.0),
        standard_error=np.where(wanted, lines[ERROR][member, *there], 0.0),
        change_error=np.where(wanted, lines[CHANGE_ERROR][member, *there], 0.0),
        relative_error=relative[classes.member],
        is_met=relative[classes.member] <= target,
    )


@dataclass(frozen=True, kw_only=True)
class _Work:
    """States to trace with the same settings.

    Attributes
    ----------
    tops : tops of all groups
    states : (n,) numbers of the states' tops
    asked : (n, emitter, receiver) mask of the pairs to trace
    settings, seed : accuracy and seed
    """

    tops: Tops | GridTops
    states: IntArray
    asked: BoolArray
    settings: Accuracy
    seed: int


def _rows_of(work: _Work, kept: KeptRows | None, on_done: Callable[[int], None]) -> FloatArray:
    """(n, emitter, line, receiver) rows of light, read from the store or traced.

    on_done : function called with the number of states left
    """
    rows = np.zeros((*work.asked.shape[:2], ROW, work.asked.shape[2]))
    rows[:, :, SCALE] = 1.0
    missing = np.asarray(work.asked.any(axis=2))
    names: list[list[bytes]] = []
    if kept is not None:
        names = work.tops.names(work.states, work.asked, work.settings, work.seed, kept)
        missing &= ~_read(rows, missing, names, kept)
    todo = np.flatnonzero(missing.any(axis=1))
    on_done(len(todo))
    batch = BATCH_GRIDS if isinstance(work.tops, GridTops) else BATCH_STATES
    for start in range(0, len(todo), batch):
        part = todo[start : start + batch]
        traced = _traced_rows(work, part, work.asked[part] & missing[part][:, :, None])
        at, emitters = np.nonzero(missing[part])
        rows[part[at], emitters] = traced[at, emitters]
        if kept is not None:
            kept.write({names[k][i]: content_of(rows[k, i]) for k, i in zip(part[at], emitters, strict=True)})
        on_done(len(todo) - start - len(part))
    return rows


def _read(rows: FloatArray, wanted: BoolArray, names: list[list[bytes]], kept: KeptRows) -> BoolArray:
    """Fill `rows` with the requested rows of light that are stored; return the mask (n, emitter) of those found."""
    places = [(int(k), int(i)) for k, i in np.argwhere(wanted)]
    found = kept.read([names[k][i] for k, i in places])
    there = np.zeros(wanted.shape, dtype=np.bool_)
    for k, i in places:
        row = row_of(found.get(names[k][i], b""), rows.shape[2:])
        if row is not None:
            rows[k, i], there[k, i] = row, True
    return there


def _traced_rows(work: _Work, part: IntArray, wanted: BoolArray) -> FloatArray:
    """(n, emitter, line, receiver) rows of light of some states, newly traced."""
    rows = np.empty((*wanted.shape[:2], ROW, wanted.shape[2]))
    scene, (stack, states) = work.tops.scene, work.tops.some(work.states[part])
    if isinstance(stack, FormedStack):
        light = trace_formed(scene, stack, states, work.settings, work.seed, wanted)
        rows[:, :, OF_CLASSES] = light.flux.transpose(0, 2, 1, 3)
        rows[:, :, ERROR], rows[:, :, SCALE] = light.standard_error, light.scale
        rows[:, :, CHANGE_ERROR] = light.change_error
        return rows
    fixed = untouched_pad(scene, work.settings, work.seed)
    values, once = _trace_batch(wanted, stack, states, fixed, work.settings)
    flux = values.mean(axis=1)
    rows[:, :, OF_CLASSES] = flux.transpose(0, 2, 1, 3)
    rows[:, :, ERROR] = standard_error(values, once, fixed, work.settings)
    rows[:, :, SCALE], rows[:, :, CHANGE_ERROR] = fixed.scale, rows[:, :, ERROR]
    return rows


def _as_share_of_states(
    on_step: Callable[[int, int], None] | None, classes: int, states: int
) -> Callable[[int], None]:
    """Convert a callback for (states done, states) to a callback for the number of groups left."""

    def on_done(left: int) -> None:
        if on_step is not None:
            on_step((classes - left) * states // max(classes, 1), states)

    return on_done


def _classes(
    scene: OpticalScene,
    centres_mm: FloatArray,
    indentations: States,
    fields: Sequence[SmoothField | None] | None,
) -> StateClasses:
    """Groups of states of equal light; with fields or grids, each state is its own, as they are not compared."""
    is_grid = any(isinstance(one, GridTop) for one in indentations)
    if is_grid or (fields is not None and any(field is not None for field in fields)):
        return each_its_own(scene, len(indentations))
    return state_classes(scene, np.nan_to_num(centres_mm)[:, None], press_keys(_curves(indentations)))


def _curves(indentations: States) -> list[Indentation | None]:
    """The states' presses, none of which is a grid."""
    return [one for one in indentations if not isinstance(one, GridTop)]


def _class_pairs(wanted: BoolArray, classes: StateClasses) -> BoolArray:
    """(class, emitter, receiver) mask of the pairs that at least one state of a group requests."""
    asked = np.zeros((len(classes.first), *wanted.shape[1:]), dtype=np.bool_)
    for state, number in enumerate(classes.member):
        asked[number][np.ix_(classes.emitters[state], classes.receivers[state])] |= wanted[state]
    return asked


def _pooled(share: FloatArray, asked: BoolArray) -> FloatArray:
    """(state,) root mean square of `share` (state, emitter, receiver) over the requested pairs."""
    count = np.maximum(asked.sum(axis=(1, 2)), 1)
    return np.asarray(np.sqrt(np.where(asked, share**2, 0.0).sum(axis=(1, 2)) / count))


def _trace_batch(
    wanted: BoolArray, tops: TopStack, part: IntArray, fixed: Untouched, settings: Accuracy
) -> tuple[FloatArray, FloatArray]:
    """(state, replicate, class, emitter, receiver) flux of some states, and of it the flux mirrored once."""
    from optopad.sims.optics.engine.compiled import trace_further, trace_once
    from optopad.sims.optics.engine.states import CLASSES, SKIRT, TOPS

    rules = straight_rules(settings)
    image_rules = (
        *gauss(settings.few_emitter),
        *gauss(settings.few_receiver),
        *gauss(settings.most_emitter),
        *gauss(settings.most_receiver),
    )
    numbers = np.array(
        [
            settings.rings, settings.columns, settings.image_step, settings.top_rings, settings.top_columns,
            settings.repeat_share, settings.wall_rays, settings.whole_ratio,
            settings.ray_share,
        ],
        dtype=np.float64,
    )  # fmt: skip
    straight = np.concatenate([fixed.straight, fixed.gain[None]])
    flat = (straight, fixed.diffuse, fixed.wall, fixed.given, fixed.taken, fixed.joined)
    patches = (fixed.layout, fixed.areas)
    rows, field = tops.part(part)
    out = np.zeros((len(part), len(fixed.shifts), CLASSES, *wanted.shape[1:]))
    once = np.zeros((*out.shape[:2], *out.shape[3:]))

    def trace_one(state: int) -> None:
        given = (
            out[state],
            wanted[state],
            fixed.emitters,
            fixed.receivers,
            fixed.box,
            rows[state],
            field[state],
        )
        trace_once(*given, flat, fixed.scale, rules, image_rules, fixed.shifts, numbers)
        once[state] = out[state][:, [TOPS, SKIRT]].sum(axis=1)
        trace_further(
            *given, flat, fixed.scale, fixed.points, fixed.shifts, patches, fixed.reflectances, fixed.orders, numbers,
            fixed.rays,
        )  # fmt: skip

    run_each(trace_one, len(part))
    return out, once

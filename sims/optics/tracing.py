"""Trace a design's light under presses. A *state* is the untouched pad or one set of simultaneous presses.

States of one tip each are traced on the curve around its axis. If some state has several tips, all states are traced on
the tops that the contact model of several tips gives as grids, by the method for grids. So their light is comparable.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numba
import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.spec import SensorDesign
from optopad.sims.cache import GatheredLight, folder_fingerprint, light_store
from optopad.sims.optics.accuracy import LADDER, Accuracy, LightSignals, accuracy_of
from optopad.sims.optics.engine.general.lower import FormedStack, is_block
from optopad.sims.optics.engine.general.pad import formed_ways
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.optics.engine.trace_states import (
    CLASS_NAMES,
    GridTops,
    Inputs,
    RawLight,
    Tops,
    trace_scene,
    trace_tops,
)
from optopad.sims.optics.engine.untouched import untouched_pad
from optopad.sims.optics.scene.lower import block_form, scene_of
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField, smooth_field
from optopad.sims.optics.scene.symmetry import StateClasses, state_classes
from optopad.sims.optics.surface.tops import TopStack
from optopad.sims.press import GridTop, Indentation

if TYPE_CHECKING:
    from optopad.sims.contact.pad_surface import PadSurface

Profile = Indentation | Sequence[Indentation | None]
_SMOOTH_PARTS: WeakKeyDictionary[PadSurface, SmoothField] = WeakKeyDictionary()
"""Smooth field (the height in addition to the curve around the tip) of each surface that the contact model still
holds."""

FIELD_STEP, FIELD_FINER = 1.0 / 4.0, 2
"""Largest distance between nodes of the smooth field that a press adds to the top [tip radii], and number of height
samples per distance. On flat presets pressed by a tip radius or more, the field's heights are off by 0.12 µm rms and
its slopes by 1.0e-3 rms at most, even within a third of a millimetre of the walls, where both vary fastest."""


def trace(
    draft: Draft,
    presses: FloatArray,
    profile: Profile | None = None,
    accuracy: str | float | Accuracy = "standard",
    seed: int = 0,
    pairs: BoolArray | None = None,
    on_step: Callable[[int, int], None] | None = None,
    fields: Sequence[SmoothField | None] | None = None,
) -> LightSignals:
    """Trace a pad for a list of presses. Light that was traced before is read from disk (`light_store`).

    The light of each press is stored as soon as it is traced, so an interrupted trace continues where it stopped.

    Parameters
    ----------
    draft : the sensor, such as `Pad.of(design)`
    presses : (state, 3) or (state, tip, 3) x, y and depth of each press [mm]. A depth of 0 or less means untouched; in
        (state, tip, 3), NaN stands for an absent tip
    profile : surface to use unchanged, of states with one tip: an indentation for all states, or one for each. If None,
        the contact model computes the surface at each location
    accuracy : name (draft, score, standard, fine or reference), settings, or a required relative error, such as 0.001
    seed : seed of all random offsets; the same seed gives identical results
    pairs : (emitter, receiver) or (state, emitter, receiver) mask of the pairs to trace; the flux of others is 0
    on_step : function called with (states done, states in all)
    fields : for each state, a smooth height added to the top, or None. They are used only if `profile` is given

    Raises
    ------
    InputError : presses have a wrong shape or are outside the block, more than two tips press at once, or a profile is
        invalid or given for several tips.
    ModelScopeError : tips overlap, or the contact or surface model does not cover a press.
    """
    tips, scene = _tips(presses), scene_of(draft.design)
    wanted: dict[str, Any] = {"accuracy": accuracy, "seed": seed, "pairs": pairs}
    if profile is not None:
        given = _given_indentations(tips, profile)
        wanted |= {"on_step": on_step, "kept": light_store()}
        raw = trace_scene(scene, tips[:, 0, :2], given, fields=fields, **wanted)
    else:
        classes = _classes(scene, tips)
        if tips.shape[1] == 1:
            tops = _tops_of_presses(draft.design, scene, tips, classes)
            raw = _kept_one_by_one(tops, classes, wanted, on_step)
        else:
            grids = tops_of_tips(draft, scene, tips[classes.first])
            raw = trace_tops(grids, classes, **wanted, on_step=on_step, kept=light_store())
    return LightSignals(
        flux=raw.flux.sum(axis=0),
        by_class={name: raw.flux[k] for k, name in enumerate(CLASS_NAMES)},
        standard_error=raw.standard_error,
        change_error=raw.change_error,
        presses=tips[:, 0] if tips.shape[1] == 1 else tips,
        digest=draft.design.digest,
        seed=seed,
        relative_error=raw.relative_error,
        is_met=raw.is_met,
    )


class _MissingLightError(Exception):
    """Raised if some light is not stored yet; its argument is the number of states whose light is stored."""


@dataclass(frozen=True, kw_only=True)
class _OneTop(Tops):
    """The top of one group of equal states, taken from the tops of a whole trace."""

    whole: Tops
    number: int

    @cached_property
    def stack(self) -> TopStack | FormedStack:
        """The group's top as kernels read it, with the same bytes as in the whole trace."""
        stack, chosen = self.whole.stack, slice(self.number, self.number + 1)
        if isinstance(stack, FormedStack):
            return FormedStack(rows=stack.rows[chosen], field=stack.field[chosen])
        return replace(stack, rows=stack.rows[chosen], field=stack.field[chosen])


def _kept_one_by_one(
    tops: Tops, classes: StateClasses, wanted: dict[str, Any], on_step: Callable[[int, int], None] | None
) -> RawLight:
    """Trace groups of equal states one by one, storing each one's light when done; same result as `trace_tops`.

    Parameters
    ----------
    wanted : keyword arguments accuracy, seed and pairs of `trace_tops`
    """
    kept, tell = GatheredLight(light_store()), on_step or (lambda _done, _states: None)

    def all_is_known(done: int, states: int) -> None:
        if done < states:
            raise _MissingLightError(done)
        tell(done, states)

    try:
        try:
            return trace_tops(tops, classes, **wanted, on_step=all_is_known, kept=kept)
        except _MissingLightError as missing:
            tell(missing.args[0], len(classes.member))
        _trace_each(tops, classes, wanted, kept, tell)
        return trace_tops(tops, classes, **wanted, kept=kept)
    finally:
        kept.put_away()


def _trace_each(
    tops: Tops,
    classes: StateClasses,
    wanted: dict[str, Any],
    kept: GatheredLight,
    tell: Callable[[int, int], None],
) -> None:
    """Trace the groups of equal states that are not stored, one per thread; Ctrl-C does not wait for running ones."""
    accuracy, pairs, states = wanted["accuracy"], wanted["pairs"], len(classes.member)
    per_state = pairs is not None and np.ndim(pairs) == 3
    settings = accuracy_of(accuracy) if isinstance(accuracy, (str, Accuracy)) else LADDER[0]
    shared = untouched_pad if tops.scene.form is None else formed_ways
    ordered = np.argsort(classes.member, kind="stable")
    members = np.split(ordered, np.cumsum(np.bincount(classes.member))[:-1])

    def trace_one(number: int) -> int:
        own = members[number]
        alone = StateClasses(
            first=np.zeros(1, dtype=np.int64),
            member=np.zeros(len(own), dtype=np.int64),
            emitters=classes.emitters[own],
            receivers=classes.receivers[own],
        )
        top = _OneTop(tops.scene, tops.made, whole=tops, number=number)
        trace_tops(top, alone, **(wanted | {"pairs": pairs[own] if per_state else pairs}), kept=kept)
        return len(own)

    tops.stack  # noqa: B018 (made once, before the threads, like the data that all states share)
    pool, done = ThreadPoolExecutor(max_workers=min(int(numba.get_num_threads()), len(members))), 0
    try:
        if threading.current_thread() is threading.main_thread():  # which ignores Ctrl-C in compiled code
            pool.submit(shared, tops.scene, settings, wanted["seed"]).result()
        else:
            shared(tops.scene, settings, wanted["seed"])
        for count in pool.map(trace_one, range(len(members))):
            done += count
            tell(done, states)
            run_each(_nothing, 1)  # calls the function set by `threads.between_pieces`
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def _nothing(_number: int) -> None:
    """Piece of work that does nothing."""


def _classes(scene: OpticalScene, tips: FloatArray) -> StateClasses:
    """Groups of states that a symmetry of the layout maps onto each other; `tips` (state, tip, 3) holds the states."""
    depths = [[float(depth) if depth > 0 else None for depth in of_state] for of_state in tips[:, :, 2]]
    return state_classes(scene, tips[:, :, :2], depths)


def _tops_of_presses(
    design: SensorDesign, scene: OpticalScene, tips: FloatArray, classes: StateClasses
) -> Tops:
    """Tops of groups of equal presses; the contact model runs only if their light is not stored."""
    traced = tips[classes.first]
    source = hashlib.blake2b(
        f"{_contact_sources()} {design.surface_digest} {tips.shape}".encode() + traced.tobytes()
    )
    return Tops(scene, lambda: (traced[:, 0, :2], *_made(design, scene, traced[:, 0])), source.digest())


def tops_of_tips(draft: Draft, scene: OpticalScene, tips: FloatArray) -> GridTops:
    """Tops under several tips, on grids; `tips` (group, tip, 3) holds the presses of each group."""
    from optopad.sims.contact.held.tips import pressed_tips, require_apart
    from optopad.sims.contact.scope import contact_of

    if scene.wall_index is not None:
        raise ModelScopeError(
            "presses: light between smooth walls is traced under one tip at a time; press with one, or set "
            "surfaces.wall_finish = 'diffuse'"
        )
    for of_group in tips:
        require_apart(draft, of_group)
    ordered = np.array([of_group[np.lexsort(of_group.T)] for of_group in tips])  # their order does not matter
    contact = contact_of(draft.design)
    others = f"{_contact_sources()} {draft.design.surface_digest}".encode()

    def made(group: int) -> GridTop | None:
        return pressed_tips(contact, ordered[group]).top if (ordered[group, :, 2] > 0.0).any() else None

    return GridTops(
        scene=scene if scene.form is not None else replace(scene, form=block_form(scene)),
        inputs=Inputs(
            rows=ordered, field=[np.frombuffer(others, np.uint8).astype(np.float64)] * len(ordered)
        ),
        made=made,
    )


@cache
def _contact_sources() -> str:
    """Fingerprint of all that determines a top besides design and press: source code, data, and solver versions."""
    import scipy

    root = Path(__file__).parents[2]
    folders = (
        root / "design",
        root / "sims" / "contact",
        root / "sims" / "press.py",
        root / "sims" / "optics",
    )
    return f"{folder_fingerprint(*folders)} {scipy.__version__} {version('mujoco')}"


def _made(
    design: SensorDesign, scene: OpticalScene, presses: FloatArray
) -> tuple[list[Indentation | None], list[SmoothField | None]]:
    """The surface curve around the axis and the smooth height added to it, of each press (state, 3)."""
    pressed = np.unique(presses[presses[:, 2] > 0], axis=0)
    known = dict(zip(map(tuple, pressed.tolist()), _tops(design, scene, pressed), strict=True))
    found = [known[tuple(row.tolist())] if row[2] > 0 else (None, None) for row in presses]
    return [near for near, _ in found], [field for _, field in found]


def _tops(
    design: SensorDesign, scene: OpticalScene, presses: FloatArray
) -> Iterator[tuple[Indentation, SmoothField | None]]:
    from optopad.sims.contact.pad_surface import pad_surfaces
    from optopad.sims.contact.scope import contact_of

    if len(presses) == 0:
        return
    for surface in pad_surfaces(contact_of(design), presses):
        yield surface.near, _smooth_part(surface, scene) if is_block(scene) else None


def _smooth_part(surface: PadSurface, scene: OpticalScene) -> SmoothField:
    found = _SMOOTH_PARTS.get(surface)
    if found is None:
        found = _SMOOTH_PARTS[surface] = smooth_field(
            lambda along, across: surface.beside_mm(along[:, 0], across[0]),
            scene.length_mm,
            scene.width_mm,
            FIELD_STEP * surface.near.tip_radius_mm,
            FIELD_FINER,
        )
    return found


def _tips(presses: FloatArray) -> FloatArray:
    """(state, tip, 3) presses with zeros for absent tips; a single tip per state if no state has more than one."""
    rows = np.asarray(presses, dtype=np.float64)
    if rows.ndim not in (2, 3) or rows.shape[-1] != 3 or (rows.ndim == 3 and rows.shape[1] == 0):
        raise InputError(f"presses: shape {rows.shape}, needs (state, 3) or (state, tip, 3) of x, y, depth")
    if rows.ndim == 2:
        rows, touched = rows[:, None, :], ~(rows[:, None, 2] <= 0)
    else:
        touched = rows[:, :, 2] > 0
        if len(rows) == 0 or touched.sum(axis=1).max() <= 1:
            first = np.argmax(touched, axis=1)[:, None]
            rows = np.take_along_axis(rows, first[:, :, None], axis=1)
            touched = np.take_along_axis(touched, first, axis=1)
        rows = np.where(touched[:, :, None], rows, 0.0)
    bad = touched & ~np.isfinite(rows).all(axis=2)
    if bad.any():
        raise InputError(f"presses: state {int(np.flatnonzero(bad.any(axis=1))[0])} is not finite")
    return rows


def _given_indentations(tips: FloatArray, profile: Profile) -> list[Indentation | None]:
    if tips.shape[1] > 1:
        raise InputError(
            f"profile: given for {tips.shape[1]} tips at once, whose top only the contact model gives; leave the "
            "profile out, or press with one tip in each state"
        )
    given = [profile] * len(tips) if isinstance(profile, Indentation) else list(profile)
    if len(given) != len(tips):
        raise InputError(f"profile: {len(given)} indentations for {len(tips)} states; give one per state")
    return [one if depth > 0 else None for one, depth in zip(given, tips[:, 0, 2], strict=True)]

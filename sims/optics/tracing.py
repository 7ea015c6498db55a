"""Light of a design under presses: objects in, named signals out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError
from design.spec import SensorDesign
from sims.cache.light_store import light_store
from sims.optics.engine.trace_states import CLASS_NAMES, Accuracy, trace_scene
from sims.optics.light_signals import LightSignals
from sims.optics.scene.lower import scene_of
from sims.optics.scene.optical_scene import OpticalScene
from sims.optics.scene.smooth_field import SmoothField, sum_of_fields
from sims.optics.surface.wall_correction import SPACING_MM, wall_field
from sims.press.indentation import Indentation

FloatArray = NDArray[np.float64]
Profile = Indentation | Sequence[Indentation | Sequence[Indentation | None] | None]
Tips = list[list[Indentation | None]]


def trace(
    design: SensorDesign,
    presses: FloatArray,
    profile: Profile | None = None,
    accuracy: str | float | Accuracy = "standard",
    seed: int = 0,
    pairs: NDArray[np.bool_] | None = None,
    on_step: Callable[[int, int], None] | None = None,
    fields: Sequence[SmoothField | None] | None = None,
) -> LightSignals:
    """Trace a design's pad for a list of presses; light traced before is read from disk (`light_store`).

    Parameters
    ----------
    design : the sensor
    presses : (state, 3) rows of x, y, depth, or (state, tip, 3) with NaN rows for absent tips; depth 0 or
        less is untouched [mm]
    profile : None for the contact model, one indentation for all tips, or one per state: for all its tips, or a
        sequence of one per tip
    accuracy : draft, score, standard, fine, reference, settings, or a wanted relative error as 0.001
    seed : of all offsets; same seed, same bits
    pairs : (emitter, receiver) or (state, emitter, receiver) mask of pairs to trace; others are 0
    on_step : called with (states done, states)
    fields : one per state, added to the top, as `correction_fields` makes them; None: the centred shape everywhere

    Raises
    ------
    InputError : presses of a wrong shape or outside the block; a bad profile.
    ModelScopeError : tips whose dimples overlap; a press that contact or surface model does not cover.
    """
    tips = _tips(presses)
    indentations = _indentations(design, tips, profile)
    scene = scene_of(design)
    centres, pressed = _as_engine_takes_them(tips, indentations)
    raw = trace_scene(
        scene,
        centres,
        pressed,
        accuracy=accuracy,
        seed=seed,
        pairs=pairs,
        on_step=on_step,
        fields=fields,
        kept=light_store(),
    )
    return LightSignals(
        flux=raw.flux.sum(axis=0),
        by_class={name: raw.flux[k] for k, name in enumerate(CLASS_NAMES)},
        standard_error=raw.standard_error,
        presses=tips[:, 0] if tips.shape[1] == 1 else tips,
        digest=design.digest,
        seed=seed,
        relative_error=raw.relative_error,
        is_met=raw.is_met,
    )


def correction_fields(
    design: SensorDesign, presses: FloatArray, spacing_mm: float = SPACING_MM
) -> list[SmoothField | None]:
    """What near walls add to the top of each state, by the contact model.

    Parameters
    ----------
    design : the sensor
    presses : as `trace` takes them; several tips add up
    spacing_mm : of the fields' nodes at most [mm]

    Returns
    -------
    One field per state, to be traced beside the centred presses of `sims.contact.indent`; None where untouched.

    Raises
    ------
    InputError : presses of a wrong shape or not finite.
    ModelScopeError : a place that the wall correction does not cover.
    """
    scene, known = scene_of(design), dict[tuple[float, float, float], SmoothField]()
    fields: list[SmoothField | None] = []
    for of_state in _tips(presses):
        parts = []
        for x, y, depth in of_state[of_state[:, 2] > 0]:
            key = (float(x), float(y), float(depth))
            if key not in known:
                known[key] = _correction_field(design, scene, key, spacing_mm)
            parts.append(known[key])
        fields.append(sum_of_fields(parts) if parts else None)
    return fields


def _correction_field(
    design: SensorDesign, scene: OpticalScene, press: tuple[float, float, float], spacing_mm: float
) -> SmoothField:
    from sims.contact import indent
    from sims.contact.pad_surface import pad_surface

    x, y, depth = press
    surface = pad_surface(design, depth, (x, y))
    return wall_field(surface.wall_height_mm, indent(design, depth), (x, y), scene, spacing_mm)


def _as_engine_takes_them(tips: FloatArray, indentations: Tips) -> tuple[FloatArray, Sequence[Any]]:
    """Centres and indentations: (state, 2) and one per state for one tip, else (state, tip, 2) and a list per state."""
    if tips.shape[1] == 1:
        return tips[:, 0, :2], [of_state[0] for of_state in indentations]
    return tips[:, :, :2], indentations


def _tips(presses: FloatArray) -> FloatArray:
    """(state, tip, 3) presses; one tip a state wherever no state has more. Absent tips are zeros."""
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


def _indentations(design: SensorDesign, tips: FloatArray, profile: Profile | None) -> Tips:
    """One list per state of one indentation per tip, None where it does not touch."""
    if profile is not None:
        return _given_indentations(tips, profile)
    from sims.contact import indent

    depths = sorted({float(depth) for depth in tips[:, :, 2].ravel() if depth > 0})
    solved = {depth: indent(design, depth) for depth in depths}
    return [[solved.get(float(depth)) for depth in of_state] for of_state in tips[:, :, 2]]


def _given_indentations(tips: FloatArray, profile: Profile) -> Tips:
    per_state = [profile] * len(tips) if isinstance(profile, Indentation) else list(profile)
    if len(per_state) != len(tips):
        raise InputError(f"profile: {len(per_state)} indentations for {len(tips)} states; give one per state")
    nested: Tips = []
    for state, (given, depths) in enumerate(zip(per_state, tips[:, :, 2], strict=True)):
        each = list(given) if isinstance(given, Sequence) else [given] * len(depths)
        if len(each) != len(depths):
            raise InputError(
                f"profile: {len(each)} indentations for {len(depths)} tips of state {state}; give one per tip"
            )
        nested.append([one if depth > 0 else None for one, depth in zip(each, depths, strict=True)])
    return nested

"""What a pad sees of objects: contact, light and readings of presses by objects of any form.

The contact model gives the deformed top on a grid (`optopad.sims.contact.held.press`), the light model traces it. The
light of a touched state is the untouched pad's, as a score computes it, times the ratio of both states traced by the
method for grids. So errors of the untouched light cancel.

All objects of a press are one rigid body. It moves along the normal of the untouched top at the press's location.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.fields.packaged import data_quantities
from optopad.design.held_object import HeldObject
from optopad.design.rules.touch import rim_height_mm
from optopad.design.shape.cavity import judged_pairs, mask_of
from optopad.sims.cache import light_store
from optopad.sims.contact.held.bottoms import bottom_mm
from optopad.sims.contact.held.press import HeldPress, grid_of, held_press
from optopad.sims.contact.held.slide import pulled, slid
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.press import GridTop
from optopad.sims.readings.readout import Readout, readout_of
from optopad.sims.verdict.depth_curve import noise_units
from optopad.sims.verdict.presses import untouched_flux

Place = tuple[float, float]
AT_ONCE = 32
"""Tops that are held in memory together; each has 1 to 3 MB."""
FORCE_ERROR, FORCE_ROUNDS = 0.001, 8
"""Accepted relative error of the force under a sideways load, and most depths that are tried."""
RIM_STEP_MM = 0.5
"""Distance of the nodes beyond the pad at which objects are compared with the mold's rim."""


@dataclass(frozen=True, kw_only=True)
class AskedPress:
    """A press of objects.

    Attributes
    ----------
    held : the objects, which move as one body
    at_mm : (x, y) of the press, and of all objects without a place of their own [mm]
    depth_mm : depth of all objects without a depth of their own [mm]; None if all have one, or if a force is given
    force_n : force that presses the objects [N]; depths of single objects are then relative to each other
    shear_mm : how far the objects then move sideways, along the cavity's x and y on a flat top, along the press
        frame's axes nearest to them otherwise [mm]
    pull_n : sideways force in place of `shear_mm` [N]
    """

    held: tuple[HeldObject, ...]
    at_mm: Place
    depth_mm: float | None = None
    force_n: float | None = None
    shear_mm: Place | None = None
    pull_n: Place | None = None

    @property
    def is_sideways(self) -> bool:
        """Whether the objects move sideways after the press."""
        return self.shear_mm is not None or self.pull_n is not None

    @property
    def friction(self) -> float:
        """Coulomb's coefficient of the objects against the pad [-]; that of dry silicone if none has one.

        Raises
        ------
        InputError : the objects have different ones.
        """
        usual = data_quantities("friction.toml")["dry"].value
        found = {usual if one.friction is None else one.friction for one in self.held}
        if len(found) > 1:
            raise InputError(
                f"friction: {', '.join(f'{one:g}' for one in sorted(found))} in one press; give all objects that move "
                f"sideways the same; without one it is {usual:g}"
            )
        return found.pop()

    @property
    def reflectance(self) -> float | None:
        """Diffuse reflectance of the objects [-]; None for the design's own.

        Raises
        ------
        InputError : the objects have different finishes.
        """
        finishes = dict.fromkeys(one.finish or "that of the design's tip" for one in self.held)
        if len(finishes) > 1:
            raise InputError(
                f"finish: {', '.join(finishes)} in one press; the light model has one reflectance "
                "for all that touches; give all objects the same finish"
            )
        found = self.held[0].reflectance
        return None if found is None else found.value


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldLight:
    """Readings of a pad under objects.

    Attributes
    ----------
    untouched : (emitter, receiver) light of the untouched pad, as a share of the emitted power [-]
    flux : (press, emitter, receiver) light under each press [-]
    error : (press, emitter, receiver) standard error of its change [-]
    readout : gains and noise
    """

    untouched: FloatArray
    flux: FloatArray
    error: FloatArray
    readout: Readout

    @property
    def units(self) -> FloatArray:
        """(press, emitter, receiver) readings [noise units]."""
        return self._units(self.flux)

    @property
    def untouched_units(self) -> FloatArray:
        """(emitter, receiver) readings of the untouched pad [noise units]."""
        return self._units(self.untouched)

    @property
    def changes(self) -> FloatArray:
        """(press, emitter, receiver) change of the readings by each press [noise units]."""
        return self.units - self.untouched_units

    def _units(self, flux: FloatArray) -> FloatArray:
        return np.asarray(noise_units(self.readout.counts(flux), **self.readout.noise))


def require_asked(draft: Draft, asked: AskedPress) -> None:
    """Refuse a press that cannot be meant, before any work.

    Raises
    ------
    InputError : depth and force are both given or both missing, or finishes differ.
    ModelScopeError : an object is outside the workspace.
    """
    space, depths = draft.workspace, [one.depth for one in asked.held]
    if asked.force_n is None:
        if asked.depth_mm is None and None in depths:
            raise InputError(
                f"depth: none is given for {asked.held[depths.index(None)].words}; add --depth or --force"
            )
        if asked.depth_mm is not None and None not in depths:
            raise InputError("--depth: every object has a depth of its own; drop one")
    elif asked.depth_mm is not None or (len(depths) == 1 and depths[0] is not None):
        raise InputError("--depth: does not go with --force, which decides the depth; drop one")
    require_traced(draft)
    if asked.shear_mm is not None and asked.pull_n is not None:
        raise InputError("--shear: does not go with --pull, which decides how far the objects move; drop one")
    assert asked.reflectance is None or asked.reflectance >= 0.0
    if asked.is_sideways:
        _ = asked.friction
    for one in asked.held:
        x, y = _place(one, asked)
        if not space.contains(x, y):
            raise ModelScopeError(
                f"objects: ({x:g}, {y:g}) mm, the centre of {one.words}, is outside the workspace, {space.words}; "
                "press inside, or lower operating.workspace_margin_mm"
            )
        if asked.shear_mm is not None:
            require_way(draft, (x, y), np.array([asked.shear_mm]))


def require_traced(draft: Draft, what: str = "objects") -> None:
    """Refuse a pad whose light on grids is not modelled; `what` presses it, for the message."""
    if draft.wall_index is not None:
        raise ModelScopeError(
            f"{what}: light between smooth walls is traced under the design's tip alone; set surfaces.wall_finish = "
            "'diffuse'"
        )


def require_way(draft: Draft, from_mm: Place, path_mm: FloatArray) -> None:
    """Refuse a path (n, 2) from a place that leads out of the workspace."""
    space = draft.workspace
    for dx, dy in np.round(path_mm, 3).tolist():
        x, y = from_mm[0] + dx, from_mm[1] + dy
        if not space.contains(x, y):
            raise ModelScopeError(
                f"shear: {dx:g}, {dy:g} mm from ({from_mm[0]:g}, {from_mm[1]:g}) mm leads to ({x:g}, {y:g}) mm, "
                f"outside the workspace, {space.words}; move the objects less far"
            )


def pressed(draft: Draft, asked: AskedPress) -> HeldPress:
    """Solve the contact of a press; errors are those of `require_asked`, `held_press` and `slid`."""
    if asked.shear_mm is not None:
        return slid_presses(draft, asked, np.array([asked.shear_mm]))[0]
    if asked.pull_n is None:
        return _Bottoms(draft, asked).press()
    bottoms, pull = _Bottoms(draft, asked), asked.pull_n
    found = bottoms.at_force(lambda depth: pulled(**bottoms.sideways(depth), pull_n=bottoms.in_frame(pull)))
    bottoms.require_rim(found.depth_mm, np.array(found.shear_mm))
    found = bottoms.in_cavity(found)
    for one in asked.held:
        require_way(draft, _place(one, asked), np.array([found.shear_mm]))
    return found


def slid_presses(draft: Draft, asked: AskedPress, path_mm: FloatArray) -> list[HeldPress]:
    """Solve the contact of objects that are pressed, then moved along a path (n, 2) as `AskedPress.shear_mm`.

    With a force, the depth is that which gives the force at the end of the path.
    """
    bottoms = _Bottoms(draft, asked)
    for one in asked.held:
        require_way(draft, _place(one, asked), path_mm)
    path = np.array([bottoms.in_frame((x, y)) for x, y in np.asarray(path_mm).tolist()])
    found: list[HeldPress] = []

    def end(depth_mm: float) -> HeldPress:
        found[:] = slid(**bottoms.sideways(depth_mm), path_mm=path)
        return found[-1]

    bottoms.at_force(end)
    for shift in path:
        bottoms.require_rim(found[-1].depth_mm, shift)
    return [bottoms.in_cavity(one) for one in found]


class _Bottoms:
    """The lowest surface of the objects of a press over the pad's grid and the rim around it."""

    def __init__(self, draft: Draft, asked: AskedPress) -> None:
        require_asked(draft, asked)
        self._draft, self._asked = draft, asked
        self._contact, top = contact_of(draft.design), draft.plan.top
        origin, axes = top.press_frame(*asked.at_mm)
        x_mm, y_mm = grid_of(self._contact, asked.at_mm)
        self._depths = [_depth(one, asked) for one in asked.held]
        wall_mm = max(draft.outline.wall_x_mm, draft.outline.wall_y_mm) if top.is_flat else 0.0
        around = RIM_STEP_MM * np.arange(1, math.ceil(wall_mm / RIM_STEP_MM) + 1)
        pad = tuple(slice(len(around), len(around) + len(one)) for one in (x_mm, y_mm))
        self._wide = [np.concatenate([one[0] - around[::-1], one, one[-1] + around]) for one in (x_mm, y_mm)]
        sag_mm = top.in_frame.sag_mm(*np.meshgrid(*self._wide, indexing="ij"))
        each = []
        for one, depth in zip(asked.held, self._depths, strict=True):
            x, y = _place(one, asked)
            at = axes[:2] @ (np.array([x, y, float(top.height_mm(x, y))]) - origin)
            own = bottom_mm(
                one.model_copy(update={"yaw": one.yaw - top.frame_turn_deg}),
                self._wide[0] - at[0],
                self._wide[1] - at[1],
            )
            if len(self._depths) > 1 and not top.is_flat:
                own -= float(np.nanmin(own + sag_mm))  # each from its own first touch
            each.append(own + max(self._depths) - depth)
        self._each = np.array(each)
        self._lowest = self._each.min(axis=0)[pad]

    def press(self) -> HeldPress:
        """The press without a sideways motion."""
        asked, lowest = self._asked, self._lowest
        if asked.force_n is None:
            self.require_rim(max(self._depths))
            return held_press(self._contact, asked.at_mm, lowest, depth_mm=max(self._depths))
        found = held_press(self._contact, asked.at_mm, lowest, force_n=asked.force_n)
        self.require_rim(found.depth_mm)
        return found

    def at_force(self, moved: Callable[[float], HeldPress]) -> HeldPress:
        """A press that is a function of its depth [mm], with the force that is asked for, if any."""
        wanted = self._asked.force_n
        if wanted is None:
            self.require_rim(max(self._depths))
            return moved(max(self._depths))
        depth = self.press().depth_mm
        for _ in range(FORCE_ROUNDS):
            found = moved(depth)
            if abs(found.force_n - wanted) <= FORCE_ERROR * wanted:
                return found
            depth *= (wanted / found.force_n) ** (2.0 / 3.0)
        raise ModelScopeError(
            f"force: no depth was found at which the objects press with {wanted:g} N after their motion sideways; move "
            "them less far, or give --depth"
        )

    def sideways(self, depth_mm: float) -> dict[str, Any]:
        """The arguments of `slid` and `pulled` at a depth."""
        asked = self._asked
        return {
            "contact": self._contact,
            "at_mm": asked.at_mm,
            "bottoms": self._lowest,
            "depth_mm": depth_mm,
            "friction": asked.friction,
        }

    def in_frame(self, sideways: Place, sign: float = 1.0) -> Place:
        """Components along the press frame's x and y of a vector along those of the cavity; the inverse with -1."""
        angle = sign * math.radians(self._draft.plan.top.frame_turn_deg)
        x, y = sideways
        return math.cos(angle) * x + math.sin(angle) * y, math.cos(angle) * y - math.sin(angle) * x

    def in_cavity(self, press: HeldPress) -> HeldPress:
        """A press with its sideways motion and force along the cavity's x and y."""
        return replace(
            press, shear_mm=self.in_frame(press.shear_mm, -1.0), pull_n=self.in_frame(press.pull_n, -1.0)
        )

    def require_rim(self, depth_mm: float, shift_mm: FloatArray | None = None) -> None:
        """Refuse objects that touch the rim at a depth, also if they are moved sideways (2,)."""
        x, y = (
            self._wide
            if shift_mm is None
            else (one + by for one, by in zip(self._wide, shift_mm, strict=True))
        )
        _require_rim(self._draft, self._asked, self._each - depth_mm, x, y)


def _require_rim(
    draft: Draft, asked: AskedPress, above_mm: FloatArray, x_mm: FloatArray, y_mm: FloatArray
) -> None:
    """Refuse objects that touch the rim around a flat pad, given each one's heights (object, nx, ny) above its top."""
    if not draft.plan.top.is_flat:
        return
    x, y = asked.at_mm
    out_mm = -draft.plan.outline.gap_mm(*np.meshgrid(x + x_mm, y + y_mm, indexing="ij"))
    touches = (out_mm >= -1e-9) & (above_mm < rim_height_mm(draft.outline, out_mm) - 1e-9)
    for one in np.flatnonzero(touches.any(axis=(1, 2)))[:1]:
        rim_mm = draft.outline.highest_mm - draft.outline.fill_mm
        raise ModelScopeError(
            f"objects: {asked.held[one].words} would touch the rim around the pad, {rim_mm:.3g} mm above it; take a "
            "smaller object, move it to the middle, or lower mold.rim_mm"
        )


def _place(held: HeldObject, asked: AskedPress) -> Place:
    return asked.at_mm[0] if held.x is None else held.x, asked.at_mm[1] if held.y is None else held.y


def _depth(held: HeldObject, asked: AskedPress) -> float:
    common = 0.0 if asked.depth_mm is None else asked.depth_mm
    return common if held.depth is None else held.depth


def all_pressed(
    draft: Draft, asked: Sequence[AskedPress], on_step: Callable[[int, int], None] | None = None
) -> list[HeldPress]:
    """Solve many presses, on all cores.

    on_step : called with (presses done, presses)
    """
    for one in asked:
        require_asked(draft, one)
    found: list[HeldPress | None] = [None] * len(asked)
    done = 0

    def solve(number: int) -> None:
        nonlocal done
        found[number] = pressed(draft, asked[number])
        done += 1
        if on_step is not None:
            on_step(done, len(asked))

    run_each(solve, len(asked))
    return [one for one in found if one is not None]


def held_light(draft: Draft, presses: Sequence[HeldPress], **settings: Any) -> HeldLight:
    """Trace the light of presses; `settings` are those of `light_of_tops`."""
    return light_of_tops(draft, [one.top for one in presses], **settings)


def light_of_tops(
    draft: Draft,
    formed: Sequence[GridTop | None],
    *,
    reflectance: float | None = None,
    accuracy: str | Accuracy = "score",
    seed: int = 0,
    pairs: BoolArray | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> HeldLight:
    """Trace the light of tops, all under objects of one reflectance. Light that was traced before is read from disk.

    Parameters
    ----------
    formed : tops; None is an untouched one
    reflectance : diffuse reflectance of what touches [-]; None is the design's `surfaces.tip_reflectance`
    accuracy, seed : settings of the light model
    pairs : (emitter, receiver) mask of the pairs to trace; others keep their untouched light
    on_step : called with (tops done, tops)
    """
    scene = scene_of(draft.design)
    if reflectance is not None:
        scene = replace(scene, tip_reflectance=reflectance)
    settings: dict[str, Any] = {"accuracy": accuracy, "seed": seed, "pairs": pairs, "kept": light_store()}
    untouched, flux, error = untouched_flux(draft, seed=seed), [], []
    for start in range(0, len(formed), AT_ONCE):
        tops = [None, *formed[start : start + AT_ONCE]]

        def tell(done: int, total: int, start: int = start) -> None:
            if on_step is not None:
                on_step(start + done * (total - 1) // total, len(formed))

        light = trace_scene(scene, np.zeros((len(tops), 2)), tops, on_step=tell, **settings)
        traced = light.flux.sum(axis=0)
        whole = np.where(traced[0] > 0.0, traced[0], 1.0)
        flux.append(untouched * np.where(traced[0] > 0.0, traced[1:] / whole, 1.0))
        error.append(untouched * light.change_error[1:] / whole)
    readout = readout_of(draft, untouched, mask_of(judged_pairs(draft.cavity), draft.cavity))
    return HeldLight(
        untouched=untouched, flux=np.concatenate(flux), error=np.concatenate(error), readout=readout
    )

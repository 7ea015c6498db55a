"""Computes what a pad sees of objects that are pressed into it: signals, force and a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from optopad.cli.verb import require_folder, typed, verb
from optopad.design.draft import Draft
from optopad.design.errors import InputError, shown
from optopad.design.held_object import HeldObject, held_of, read_held
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, program_digest
from optopad.screen.held import HeldView
from optopad.screen.output import Told
from optopad.screen.training import data_lines
from optopad.sims.held import AskedPress, held_light, pressed
from optopad.sims.held_data import held_data, read_presses
from optopad.sims.plots.files import write_plot
from optopad.sims.plots.held import plot_held
from optopad.sims.plots.style import plain_style
from optopad.work import OUT

STEM = "press-objects"


def press(
    design: SensorDesign,
    *objects: str,
    at: tuple[float, float] | None = None,
    depth: float | None = None,
    force: float | None = None,
    shear: tuple[float, float] | None = None,
    pull: tuple[float, float] | None = None,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> HeldView:
    """Compute what a pad sees of objects that press it as one; nothing is written.

    Parameters
    ----------
    objects : each as ``cylinder,radius=5,yaw=30``, or a file with tables [object]; a sphere if none is given
    at : x, y of the press in the cavity [mm]; the middle if left out
    depth : depth from first touch [mm]; 1 if neither it nor a force is given
    force : force in place of a depth [N]
    shear : how far the objects then move sideways, along x and y [mm]
    pull : sideways force along x and y in place of that [N]

    Raises
    ------
    DesignError, InputError, ModelScopeError : the design breaks a rule, or a press is invalid or outside the models.
    """
    require_valid(design)
    draft, tell = Draft.of(design), on_step or (lambda _stage, _share: None)
    asked = replace(asked_press(draft, objects, at, depth, force), shear_mm=shear, pull_n=pull)
    tell("objects", 0.0)
    found = pressed(draft, asked)
    tell("objects", 1.0)
    light = held_light(
        draft,
        [found],
        reflectance=asked.reflectance,
        accuracy="standard",
        seed=seed,
        on_step=lambda done, total: tell("light", done / total),
    )
    return HeldView(draft=draft, asked=asked, press=found, light=light, young=draft.modulus)


@verb(
    object=typed("KIND,KEY=VALUE|FILE"),
    at=typed("X,Y"),
    depth=typed("MM"),
    force=typed("N"),
    shear=typed("X,Y"),
    pull=typed("X,Y"),
    presses=typed("FILE", flag="--list"),
    out=typed("FOLDER", type=Path, callback=require_folder),
    set_before="out",
)
def press_command(
    design: SensorDesign,
    *,
    object: Sequence[str] = (),
    at: str | None = None,
    depth: float | None = None,
    force: str | None = None,
    shear: str | None = None,
    pull: str | None = None,
    presses: Path | None = None,
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep,
) -> HeldView | Told:
    """Compute what the pad sees of an object: signals, force, contact and a picture.

    Parameters
    ----------
    object : What presses: sphere, ellipsoid, cylinder, box, punch, torus or mesh with its sizes and pose, as
        cylinder,radius=5,yaw=30, or a file with tables [object]. Repeatable; all objects move as one. Default: sphere.
    at : Where, in the cavity [mm]. Default: the middle.
    depth : Depth from first touch [mm]. Default: 1, or --force.
    force : Force in place of a depth, as 2N.
    shear : How far the objects then move sideways, along x and y [mm]: they stick, slip partly or slide.
    pull : Sideways force along x and y in place of --shear [N].
    presses : Make a data set of many presses, a row each: x_mm, y_mm, depth_mm or force_n; also object, its keys, and
        a second touch by the same ball: x2_mm, y2_mm, depth2_mm.
    out : Also write the picture, as SVG and PNG, into the bundle in this folder.
    """
    if presses is not None:
        given_too = {"--at": at, "--depth": depth, "--force": force, "--shear": shear, "--pull": pull}
        for name, given in given_too.items():
            if given is not None:
                raise InputError(f"{name}: does not go with --list, which has presses of its own; drop one")
        return _data_set(design, presses, object, Path(OUT) if out is None else out, seed, on_step)
    view = press(
        design,
        *object,
        at=_two("--at", at, "millimetres", "mm", "16,16"),
        depth=depth,
        force=None if force is None else _newtons(force),
        shear=_two("--shear", shear, "millimetres", "mm", "0.3,0"),
        pull=_two("--pull", pull, "newtons", "N", "0.5,0"),
        seed=seed,
        on_step=on_step,
    )
    if out is None:
        return view
    with bundle(design, out, seed=seed) as folder, plain_style():
        (folder / "sims").mkdir(exist_ok=True)
        files = write_plot(
            plot_held(view.draft, view.press.top, view.changes, view.words), folder / "sims" / STEM
        )
    return replace(view, files=tuple(out / bundle_name(design) / "sims" / file.name for file in files))


def _data_set(
    design: SensorDesign, file: Path, objects: Sequence[str], out: Path, seed: int, on_step: OnStep
) -> Told:
    """Write the data set of a list of presses into the bundle."""
    require_valid(design)
    held = [one for text in objects for one in _held(text)]
    if len(held) > 1:
        raise InputError(
            f"--object: {len(held)} objects with --list, whose presses are by one each; give one"
        )
    listed = read_presses(file, held[0] if held else None)
    name = f"data-{file.stem}-{seed}.nc"
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        made = held_data(
            design,
            listed,
            folder / "sims" / name,
            seed=seed,
            asked=[seed, program_digest()],
            journal_folder=out,
            on_step=on_step,
        )
    made["file"] = str(out / bundle_name(design) / "sims" / name)
    return Told(made, data_lines(made))


def asked_press(
    draft: Draft,
    objects: Sequence[str],
    at: tuple[float, float] | None,
    depth_mm: float | None,
    force_n: float | None,
) -> AskedPress:
    """The press that is asked for.

    Raises
    ------
    DesignError, InputError : an object or a depth is invalid.
    """
    held = tuple(one for text in objects or ("sphere",) for one in _held(text))
    if depth_mm is not None and not (math.isfinite(depth_mm) and depth_mm >= 0.0):
        raise InputError(
            f"--depth: {depth_mm:g} mm is refused: it is measured from first touch down; give 0 or more"
        )
    if at is not None and len(held) == 1 and not (held[0].x is None and held[0].y is None):
        raise InputError("--at: the object has x or y of its own; drop one")
    is_open = force_n is None and any(one.depth is None for one in held)
    place = _middle(draft, held) if at is None else at
    return AskedPress(
        held=held, at_mm=place, depth_mm=1.0 if depth_mm is None and is_open else depth_mm, force_n=force_n
    )


def _held(text: str) -> tuple[HeldObject, ...]:
    """Objects from a text or, if it names one, from a file."""
    return read_held(Path(text)) if text.lower().endswith(".toml") else (held_of(text),)


def _middle(draft: Draft, held: Sequence[HeldObject]) -> tuple[float, float]:
    """The first object's own place, or the middle of the workspace [mm]."""
    first = held[0]
    middle = draft.workspace.clamped(*draft.plan.centre_mm)
    return middle[0] if first.x is None else first.x, middle[1] if first.y is None else first.y


def _two(name: str, text: str | None, unit: str, sign: str, example: str) -> tuple[float, float] | None:
    """Two numbers from the text of an option."""
    if text is None:
        return None
    parts = [part.strip().removesuffix(sign) for part in text.split(",")]
    try:
        x, y = (float(part) for part in parts)
    except ValueError:
        raise InputError(f"{name}: {shown(text)} is refused: write X,Y in {unit}, as {example}") from None
    if not np.isfinite([x, y]).all():
        raise InputError(f"{name}: {shown(text)} is refused: needs two finite numbers of {unit}")
    return x, y


def _newtons(text: str) -> float:
    try:
        value = float(text.strip().removesuffix("N"))
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"--force: {shown(text)} is refused: write a force above 0 in newtons, as 2N")
    return value

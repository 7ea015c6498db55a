"""Computes what a pad sees of objects that are pressed into it: signals, force and a picture."""

from __future__ import annotations

import math
import re
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


@verb(
    object=typed("KIND,KEY=VALUE|FILE"),
    at=typed("X,Y"),
    depth=typed("MM"),
    force=typed("N"),
    presses=typed("FILE", flag="--list"),
    out=typed("FOLDER", type=Path, callback=require_folder),
    set_before="out",
)
def press(
    design: SensorDesign,
    *,
    object: Sequence[str] = (),
    at: str | None = None,
    depth: float | None = None,
    force: str | None = None,
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
    presses : Make a data set of many presses, a row each: x_mm, y_mm, depth_mm or force_n; also object and its keys.
    out : Also write the picture, as SVG and PNG, into the bundle in this folder.
    """
    require_valid(design)
    if presses is not None:
        for name, given in (("--at", at), ("--depth", depth), ("--force", force)):
            if given is not None:
                raise InputError(f"{name}: does not go with --list, which has presses of its own; drop one")
        return _data_set(design, presses, object, Path(OUT) if out is None else out, seed, on_step)
    draft = Draft.of(design)
    asked = asked_press(draft, object, at, depth, force)
    on_step("objects", 0.0)
    found = pressed(draft, asked)
    on_step("objects", 1.0)
    light = held_light(
        draft,
        [found],
        reflectance=asked.reflectance,
        accuracy="standard",
        seed=seed,
        on_step=lambda done, total: on_step("light", done / total),
    )
    view = HeldView(draft=draft, asked=asked, press=found, light=light, young=draft.modulus)
    if out is None:
        return view
    with bundle(design, out, seed=seed) as folder, plain_style():
        (folder / "sims").mkdir(exist_ok=True)
        files = write_plot(plot_held(draft, found.top, view.changes, view.words), folder / "sims" / STEM)
    return replace(view, files=tuple(out / bundle_name(design) / "sims" / file.name for file in files))


def _data_set(
    design: SensorDesign, file: Path, objects: Sequence[str], out: Path, seed: int, on_step: OnStep
) -> Told:
    """Write the data set of a list of presses into the bundle."""
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
    draft: Draft, objects: Sequence[str], at: str | None, depth_mm: float | None, force: str | None
) -> AskedPress:
    """The press that the options of a command describe.

    Raises
    ------
    DesignError, InputError : an object, a place, a depth or a force is invalid.
    """
    held = tuple(one for text in objects or ("sphere",) for one in _held(text))
    force_n = None if force is None else _number(force, "N", "--force")
    if depth_mm is not None and not (math.isfinite(depth_mm) and depth_mm >= 0.0):
        raise InputError(
            f"--depth: {depth_mm:g} mm is refused: depth is measured from first touch down; give 0 or more"
        )
    is_open = force_n is None and any(one.depth is None for one in held)
    place = _middle(draft, held) if at is None else _place(at)
    return AskedPress(
        held=held, at_mm=place, depth_mm=1.0 if depth_mm is None and is_open else depth_mm, force_n=force_n
    )


def _held(text: str) -> tuple[HeldObject, ...]:
    """Objects from a text or, if it names one, from a file."""
    return read_held(Path(text)) if text.endswith(".toml") else (held_of(text),)


def _middle(draft: Draft, held: Sequence[HeldObject]) -> tuple[float, float]:
    """The first object's own place, or the middle of the workspace [mm]."""
    first = held[0]
    middle = draft.workspace.clamped(*draft.plan.centre_mm)
    return middle[0] if first.x is None else first.x, middle[1] if first.y is None else first.y


def _place(text: str) -> tuple[float, float]:
    parts = [part.strip().removesuffix("mm") for part in text.split(",")]
    try:
        x, y = (float(part) for part in parts)
    except ValueError:
        raise InputError(f"--at: {shown(text)} is refused: write X,Y in millimetres, as 16,16") from None
    if not np.isfinite([x, y]).all():
        raise InputError(f"--at: {shown(text)} is refused: needs two finite numbers of millimetres")
    return x, y


def _number(text: str, unit: str, name: str) -> float:
    found = re.fullmatch(rf"\s*([0-9.eE+-]+)\s*{unit}?\s*", text)
    try:
        value = float(found[1]) if found else math.nan
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name}: {shown(text)} is refused: write a force above 0 in newtons, as 2{unit}")
    return value

"""Pictures of light paths in a pad under presses, and their data, for the bundle."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optopad.cli.verb import parsed_press, typed, verb
from optopad.design.errors import InputError
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of, chord_midpoint_mm, pair_name
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.rays import RayView
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.plots.files import write_plot
from optopad.sims.plots.ray_sheet import ray_sheet
from optopad.sims.plots.rays import Cut, cut_across, cut_of_pair, cut_through
from optopad.sims.plots.style import plain_style
from optopad.sims.rays import Pair, Press, RayChoice, ray_states
from optopad.verbs.simulate import require_presses
from optopad.work import OUT

PREFIX = "rays"
Aim = tuple[int | None, int | None]
"""Number of an emitter and of a receiver, from 0; None for all."""
DEFAULT_DEPTHS = (0.2, 0.4, 0.8)
"""Depths of the default presses, as fractions of the design's deepest press [-]."""


@verb(
    emitter=typed("E1"),
    receiver=typed("R1"),
    press=typed("X,Y,DEPTH"),
    count=typed(min=1, max=200),
    set_before="out",
)
def rays(
    design: SensorDesign,
    *,
    emitter: str | None = None,
    receiver: str | None = None,
    press: Sequence[str] = (),
    count: int = 24,
    out: Path = Path(OUT),
    seed: int = 0,
    on_step: OnStep,
) -> RayView:
    """Draw sample paths of light, untouched and pressed: mode 1, mode 2, scattered, lost; pictures in the bundle.

    Parameters
    ----------
    emitter : One emitter, by its name in the wiring table. Default: all.
    receiver : One receiver, by its name. With --emitter: a pair, cut along its chord.
    press : A press [mm]; repeatable. Default: both ends of the deadband if a verdict found one, else three depths, at
        the pair's middle or the pad's location of least margin.
    count : Number of paths of the strongest kind of light.
    """
    presses, cavity = tuple(parsed_press(text) for text in press), cavity_of(design)
    aim = (
        None if emitter is None else part_number(cavity.emitters, emitter, "--emitter"),
        None if receiver is None else part_number(cavity.receivers, receiver, "--receiver"),
    )
    view = _view(design, aim, presses, count, out, seed, on_step)
    return replace(view, files=_pictures(view, out))


def part_number(parts: Sequence[PlacedPart], text: str, field: str) -> int:
    """Index, from 0, of a part that is given by its name or number in the wiring table.

    Raises
    ------
    InputError : there is no such part; the message lists the existing ones.
    """
    names = [part.name for part in parts]
    letter = names[0][0]
    wanted = text.strip().upper()
    wanted = wanted if wanted.startswith(letter) else f"{letter}{wanted}"
    if wanted not in names:
        raise InputError(f"{field}: {text!r} does not exist; the design has {', '.join(names)}")
    return names.index(wanted)


def _view(
    design: SensorDesign,
    aim: Aim,
    presses: tuple[Press, ...],
    count: int,
    out: Path,
    seed: int,
    on_step: OnStep,
) -> RayView:
    """Trace light paths and their powers; presses are chosen from the verdict in the bundle if none are given."""
    require_valid(design)
    cavity = cavity_of(design)
    why = "as requested"
    if not presses:
        presses, why = _telling_presses(design, _pair(aim), out / bundle_name(design) / "sims" / "score.json")
    require_presses(design, np.array(presses))
    presses = tuple(press for press in presses if press[2] > 0.0)
    if presses:
        deepest = max(design.operating.max_depth_mm, *(press[2] for press in presses))
        solved_press(
            contact_of(design), max_depth_mm=deepest, on_step=lambda share: on_step("contact", share)
        )
    is_aimed = aim[1] is not None
    choice = RayChoice(pairs=_pairs(cavity, aim), count=count, shows_all_losses=not is_aimed, seed=seed)
    return RayView(
        design=design,
        name=_name(cavity, aim),
        cut=_cut(cavity, aim, presses),
        states=ray_states(design, choice, presses, on_step=lambda share: on_step("rays", share)),
        is_aimed=is_aimed,
        presses_are=why,
        seed=seed,
    )


def _pair(aim: Aim) -> Pair | None:
    """The requested pair; None if the request is not for a single emitter and a single receiver."""
    return None if aim[0] is None or aim[1] is None else (aim[0], aim[1])


def _pairs(cavity: CavityGeometry, aim: Aim) -> tuple[Pair, ...]:
    emitters = range(len(cavity.emitters)) if aim[0] is None else [aim[0]]
    receivers = range(len(cavity.receivers)) if aim[1] is None else [aim[1]]
    return tuple((emitter, receiver) for emitter in emitters for receiver in receivers)


def _chosen(cavity: CavityGeometry, aim: Aim) -> list[PlacedPart]:
    sides = zip((cavity.emitters, cavity.receivers), aim, strict=True)
    return [parts[number] for parts, number in sides if number is not None]


def _name(cavity: CavityGeometry, aim: Aim) -> str:
    return "-".join(part.name for part in _chosen(cavity, aim)) or "all"


def _cut(cavity: CavityGeometry, aim: Aim, presses: Sequence[Press]) -> Cut:
    if (pair := _pair(aim)) is not None:
        return cut_of_pair(cavity, pair)
    if chosen := _chosen(cavity, aim):
        return cut_across(cavity, chosen[0])
    return cut_through(cavity, *(presses[0][:2] if presses else _middle(cavity)))


def _middle(cavity: CavityGeometry) -> tuple[float, float]:
    return cavity.length_mm / 2, cavity.width_mm / 2


def _telling_presses(design: SensorDesign, pair: Pair | None, score: Path) -> tuple[tuple[Press, ...], str]:
    """The most informative presses, and why they were chosen.

    Their depths are both ends of the longest deadband there; if there is none, three default depths.
    """
    cavity = cavity_of(design)
    place, spans = _judged(cavity, pair, _read_score(score))
    if spans:
        start, end = max(spans, key=lambda span: span[1] - span[0])
        return (
            (*place, start),
            (*place, end),
        ), f"where the deadband from {start:g} to {end:g} mm begins and ends"
    depths = (round(share * design.operating.max_depth_mm, 3) for share in DEFAULT_DEPTHS)
    presses: tuple[Press, ...] = tuple((*place, depth) for depth in depths)
    if pair is not None:
        return presses, "at the middle of the chord"
    if score.is_file():
        return presses, "at the location of least margin"
    return presses, ("at the middle of the workspace; after `optopad score`, at the location of least margin")


def _judged(
    cavity: CavityGeometry, pair: Pair | None, score: dict[str, Any]
) -> tuple[tuple[float, float], list[tuple[float, float]]]:
    """Location to press [mm], and the depth intervals of the deadbands there according to the verdict.

    The location is the middle of the pair's chord or, if `pair` is None, the pad's location of least margin. Without a
    verdict it is the middle of the workspace.
    """
    try:
        if pair is not None:
            name = pair_name(cavity, pair)
            found = [row["deadbands_mm"] for row in score.get("pairs", []) if row["pair"] == name]
            return chord_midpoint_mm(cavity, pair), [(a, b) for spans in found for a, b in spans]
        weakest = (score.get("map") or {}).get("weakest_place_mm")
        if weakest is None:
            return cavity.workspace.clamped(*_middle(cavity)), []
        is_worst = weakest == score["map"]["worst_place_mm"] and score["judged_by"] == "pad"
        spans = score["deadband_mm"]["intervals"] if is_worst else []
        return (float(weakest[0]), float(weakest[1])), [(a, b) for a, b in spans]
    except (KeyError, TypeError, ValueError):
        raise InputError("sims/score.json of the bundle is damaged; run `optopad score` again") from None


def _read_score(file: Path) -> dict[str, Any]:
    if not file.is_file():
        return {}
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise InputError(f"{file}: damaged; run `optopad score` again")
    return document


def _pictures(view: RayView, out: Path) -> tuple[Path, ...]:
    """Write the picture as SVG and PNG, and its data, into the design's bundle."""
    stem = f"{PREFIX}-{view.name}"
    with bundle(view.design, out, seed=view.seed) as folder, plain_style():
        sims = folder / "sims"
        sims.mkdir(exist_ok=True)
        for stale in (
            file for file in sims.iterdir() if re.fullmatch(r"rays(-.*)?\.(svg|png|json)", file.name)
        ):
            stale.unlink()
        figure = ray_sheet(
            view.states,
            view.design,
            view.cut,
            title=view.title,
            caption=view.caption,
            is_of_untouched=view.is_aimed,
        )
        write_plot(figure, sims / stem)
        write_text_atomically(sims / f"{PREFIX}.json", json.dumps(view.paths_json()) + "\n")
    names = (f"{stem}.svg", f"{stem}.png", f"{PREFIX}.json")
    return tuple(out / bundle_name(view.design) / "sims" / name for name in names)

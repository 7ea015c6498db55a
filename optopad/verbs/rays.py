"""Pictures of light paths in a pad under presses, and their data, for the bundle."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from optopad.cli.options import parsed_press
from optopad.cli.verb import typed, verb
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of, chord_midpoint_mm, pair_name
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.jobs.signals import require_presses
from optopad.screen.output import Told
from optopad.sims.contact.indentation import solved_press
from optopad.sims.optics.paths import LightPath
from optopad.sims.plots.ray_sheet import ray_sheet
from optopad.sims.plots.rays import Cut, cut_across, cut_of_pair, cut_through
from optopad.sims.plots.style import plain_style
from optopad.sims.rays import KINDS, LOST, Pair, Press, RayChoice, RayState, kind_of, ray_states
from optopad.work import OUT

PREFIX = "rays"
DEFAULT_DEPTHS = (0.2, 0.4, 0.8)
"""Depths of the default presses, as fractions of the design's deepest press [-]."""


@dataclass(frozen=True, kw_only=True)
class RayRequest:
    """A request for a picture of light paths.

    Attributes
    ----------
    emitter, receiver : number of the part, from 0, or None for all parts
    presses : x, y, depth of each press [mm]; if empty, the most informative presses are chosen
    count : number of paths drawn for the strongest kind of light; weaker kinds get at most this number
    """

    emitter: int | None = None
    receiver: int | None = None
    presses: tuple[Press, ...] = ()
    count: int = 24

    @property
    def pair(self) -> Pair | None:
        """The requested pair; None if the request is not for a single emitter and a single receiver."""
        return None if self.emitter is None or self.receiver is None else (self.emitter, self.receiver)


@dataclass(frozen=True, kw_only=True)
class RayView:
    """Content of a picture of light paths.

    Attributes
    ----------
    name : name of the requested light, for file names: E2-R5, E2, R5 or all
    cut : line in plan along which the pad is cut for the pictures
    states : paths and powers without contact, then under each press
    is_aimed : whether a single receiver is requested. Powers then refer to the receiver's untouched light, otherwise to
        the emitted light
    presses_are : description of why these presses were chosen
    """

    design: SensorDesign
    name: str
    cut: Cut
    states: tuple[RayState, ...]
    is_aimed: bool
    presses_are: str
    seed: int

    @property
    def unit(self) -> float:
        """Reference power of the shown fractions, as a fraction of the emitted power [-]."""
        return self.states[0].total if self.is_aimed and self.states[0].total > 0.0 else 1.0


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
) -> Told:
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
    request = RayRequest(
        emitter=None if emitter is None else part_number(cavity.emitters, emitter, "--emitter"),
        receiver=None if receiver is None else part_number(cavity.receivers, receiver, "--receiver"),
        presses=presses,
        count=count,
    )
    view = view_rays(design, request, out, seed=seed, on_step=on_step)
    files = [str(file) for file in write_pictures(view, out)]
    lines = [*view_lines(view), *(f"file      {file}" for file in files)]
    return Told(view_json(view) | {"files": files}, lines)


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


def view_rays(design: SensorDesign, request: RayRequest, out: Path, *, seed: int, on_step: OnStep) -> RayView:
    """Trace the light paths of a request and their powers; choose the presses if none are given.

    Parameters
    ----------
    out : folder of the bundles; presses are chosen from the verdict in the design's bundle, if there is one

    Raises
    ------
    DesignError : the design breaks a rule
    ModelScopeError : a press is outside the workspace, or the models refuse it
    """
    require_valid(design)
    cavity = cavity_of(design)
    presses, why = request.presses, "as requested"
    if not presses:
        presses, why = _telling_presses(
            design, request.pair, out / bundle_name(design) / "sims" / "score.json"
        )
    require_presses(design, np.array(presses))
    presses = tuple(press for press in presses if press[2] > 0.0)
    if presses:
        deepest = max(design.operating.max_depth_mm, *(press[2] for press in presses))
        solved_press(design, max_depth_mm=deepest, on_step=lambda share: on_step("contact", share))
    is_aimed = request.receiver is not None
    choice = RayChoice(
        pairs=_pairs(cavity, request), count=request.count, shows_all_losses=not is_aimed, seed=seed
    )
    return RayView(
        design=design,
        name=_name(cavity, request),
        cut=_cut(cavity, request, presses),
        states=ray_states(design, choice, presses, on_step=lambda share: on_step("rays", share)),
        is_aimed=is_aimed,
        presses_are=why,
        seed=seed,
    )


def _pairs(cavity: CavityGeometry, request: RayRequest) -> tuple[Pair, ...]:
    emitters = range(len(cavity.emitters)) if request.emitter is None else [request.emitter]
    receivers = range(len(cavity.receivers)) if request.receiver is None else [request.receiver]
    return tuple((emitter, receiver) for emitter in emitters for receiver in receivers)


def _chosen(cavity: CavityGeometry, request: RayRequest) -> list[PlacedPart]:
    emitters = [] if request.emitter is None else [cavity.emitters[request.emitter]]
    return emitters + ([] if request.receiver is None else [cavity.receivers[request.receiver]])


def _name(cavity: CavityGeometry, request: RayRequest) -> str:
    return "-".join(part.name for part in _chosen(cavity, request)) or "all"


def _cut(cavity: CavityGeometry, request: RayRequest, presses: Sequence[Press]) -> Cut:
    chosen = _chosen(cavity, request)
    if request.pair is not None:
        return cut_of_pair(cavity, request.pair)
    if chosen:
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


def view_lines(view: RayView) -> list[str]:
    """Text with the light of every press by kind of path (mode 1, mode 2, ...), one line per press."""
    of = "of the untouched light" if view.is_aimed else "of the emitted light"
    lines = [f"light     {view.name}, powers in % {of}; presses {view.presses_are}"]
    for state in view.states:
        x_mm, y_mm, depth_mm = state.press_mm
        where = f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm" if depth_mm > 0.0 else "untouched"
        shares = state.power_by_kind
        kinds = [kind for kind in KINDS if kind.key in shares]
        words = "  ".join(f"{kind.key} {100 * shares[kind.key] / view.unit:.2f}" for kind in kinds)
        lines.append(f"{where:<39} total {100 * state.total / view.unit:6.2f}  {words}")
    return lines


def view_json(view: RayView) -> dict[str, Any]:
    """Powers of the light under each press by kind of path, for JSON; without the paths."""
    return {
        "name": view.design.name,
        "digest": view.design.digest,
        "seed": view.seed,
        "light": view.name,
        "presses_are": view.presses_are,
        "power_of": "untouched light" if view.is_aimed else "emitted light",
        "unit_flux": view.unit,
        "states": [_state_json(state, view.unit) for state in view.states],
    }


def _state_json(state: RayState, unit: float) -> dict[str, Any]:
    drawn = [kind_of(path.fate).key for path in state.paths]
    return {
        "press_mm": list(state.press_mm),
        "flux_by_class": {name: float(flux.sum()) / state.emitters for name, flux in state.power.items()},
        "share_by_kind": {key: power / unit for key, power in state.power_by_kind.items()},
        "share": state.total / unit,
        "paths_by_kind": {key: drawn.count(key) for key in dict.fromkeys(drawn)} | {"lost": len(state.lost)},
    }


def paths_json(view: RayView) -> dict[str, Any]:
    """Content of a picture of light paths for JSON: powers, legend, and the points of every path."""
    document = view_json(view)
    cavity = cavity_of(view.design)
    for row, state in zip(document["states"], view.states, strict=True):
        row["paths"] = [_path_json(path, cavity) for path in state.paths]
        row["lost_paths"] = [
            _path_json(path, cavity) | {"kind": LOST.key, "arrived_at": _receiver_name(cavity, former)}
            for path, former in zip(state.lost, state.lost_by, strict=True)
        ]
    kinds = [
        {"kind": kind.key, "title": kind.title, "mode": kind.mode, "classes": list(kind.classes)}
        for kind in KINDS
    ]
    return document | {"kinds": kinds, "frame": "x, y, z in mm; z = 0 at the bottom of the clear layer"}


def _path_json(path: LightPath, cavity: CavityGeometry) -> dict[str, Any]:
    return {
        "class": path.fate,
        "kind": kind_of(path.fate).key,
        "emitter": cavity.emitters[path.emitter].name,
        "receiver": _receiver_name(cavity, path.receiver),
        "ray": path.ray,
        "places_mm": path.places_mm.round(4).tolist(),
    }


def _receiver_name(cavity: CavityGeometry, number: int) -> str | None:
    return None if number < 0 else cavity.receivers[number].name


def caption(view: RayView) -> str:
    """Text that explains the lines and numbers in a picture of light paths."""
    lost = (
        "Dotted: rays that reached the receiver while the pad was untouched, followed under the press; crosses: where "
        "they end."
        if view.is_aimed
        else "Dotted: light that reaches no receiver; crosses: where it ends."
    )
    of = "the light that arrived while the pad was untouched" if view.is_aimed else "the emitted light"
    return (
        "Lines are random sample paths of the ray tracer, drawn with a probability proportional to their "
        f"power; kinds with more power have more lines, but weak kinds are overrepresented. {lost} "
        f"Percentages are of {of}, from the light model, not from counts of lines. The section shows "
        f"paths projected from the side. Seed {view.seed}."
    )


def write_pictures(view: RayView, out: Path) -> list[Path]:
    """Write the picture as SVG and PNG, and its data, into the design's bundle; returns their paths.

    Raises
    ------
    OutputError : the folder cannot be written; an earlier bundle is intact
    """
    from optopad.design.io import write_text_atomically
    from optopad.plot_files import write_plot

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
            title=f"{view.design.name}: {_title(view)}",
            caption=caption(view),
            is_of_untouched=view.is_aimed,
        )
        write_plot(figure, sims / stem)
        write_text_atomically(sims / f"{PREFIX}.json", json.dumps(paths_json(view)) + "\n")
    names = (f"{stem}.svg", f"{stem}.png", f"{PREFIX}.json")
    return [out / bundle_name(view.design) / "sims" / name for name in names]


def _title(view: RayView) -> str:
    if "-" in view.name:
        return f"light from {view.name.replace('-', ' to ')}"
    if view.name == "all":
        return "light of all emitters"
    return f"light {'to' if view.is_aimed else 'of'} {view.name}"

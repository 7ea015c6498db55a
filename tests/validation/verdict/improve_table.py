"""Whether what `improve` proposes is right, and what it rejects is not better: two tables of docs/validation/search.md.

    python -m tests.validation.verdict.improve_table [grids | rows | pads | hand]  (hours of two cores; kept)

Random designs with fixed seeds that `score` finds a deadband in: facing rows of one to four pairs, and small pads. Each
is improved with the default budget; what is proposed is read from its file and scored anew. Of rows a grid over both
heights and the thickness, within the ranges that improve varies, is judged by a search's light, and its best designs by
the score's. A grid's design counts as better by the rule that improve itself offers designs by: no deadband where
improve has none to offer, 0.5 mm more usable depth, or a margin larger by a fifth as far as it is scarce.

The part `hand` holds changes that a person tries against what improve offers in each aim, for the pad of a gripper's
finger: all by `score`, with bounds.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import textwrap
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.errors import OptopadError
from optopad.design.io import load_design, write_text_atomically
from optopad.design.preset import preset
from optopad.design.rules.check import check
from optopad.design.search.improve import HEIGHTS, Judged, Limit, betters, improvement_space, is_sound, worth
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import CLEAR
from optopad.screen.figures import figures_of
from optopad.sims.score.build_tolerance import with_tolerance
from optopad.sims.score.objective import judge, sizes_of, with_bounds
from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import verdict_of
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.verbs.improve import improve

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "build" / "validation" / "improve"
PAGE = ROOT / "docs" / "validation" / "search.md"
ROWS, PADS = 24, 2
"""Rows, and pads of each shape."""
WIDTH = 118
"""Of a line of the page."""
GRID = 6
"""Values of each of the three fields: 216 designs."""
JUDGED_AGAIN = 3
"""Best designs of a grid that are judged by the score's light."""
SHAPES = ("rectangle", "disc", "dome")
PAIR, PAD, DOME = (preset(name) for name in ("piacenza2017-pair", "fingertip-16", "fingertip-dome"))
PARTS = (("sunled-xscwd23mb", "osram-sfh206k"), ("kingbright-apt2012zgc", "osram-sfh2400"))
HAND_BEGIN, HAND_END = "<!-- hand: begin -->", "<!-- hand: end -->"
MARGIN = "operating.workspace_margin_mm"
HAND = (
    {},
    {"gain.target_counts": 600.0},
    {"gain.target_counts": 1200.0},
    {"gain.target_counts": 2000.0},
    {CLEAR: 5.5},
    {CLEAR: 6.0},
    {CLEAR: 5.5, "gain.target_counts": 1200.0},
    {HEIGHTS[0]: 2.3, HEIGHTS[1]: 2.5},
    {HEIGHTS[0]: 1.9, HEIGHTS[1]: 2.1},
    {CLEAR: 5.5, "gain.target_counts": 1200.0, MARGIN: 1.6},
)
"""What a person tries."""
FIGURES = {
    "margin": ("margin", "sigma", -1.0),
    "location": ("location_bound_mm", "mm", 1.0),
    "contact": ("detection_force_n", "N", 1.0),
    "size": ("outer_volume_cm3", "cm3", 1.0),
    "flush": ("above_surface_mm", "mm", 1.0),
}
"""Figure of each aim, its unit, and 1 if less is better."""
BEGIN, END = "<!-- improve: begin -->", "<!-- improve: end -->"


def random_row(seed: int) -> SensorDesign:
    """Facing rows of one to four pairs."""
    chance = np.random.default_rng([1, seed])
    emitter, receiver = PARTS[int(chance.integers(2))]
    clear = round(float(chance.uniform(5.0, 11.0)), 1)
    tip = float(chance.choice([2.0, 2.5, 3.0]))
    length, width = (round(float(size), 0) for size in chance.uniform(16.0, 30.0, 2))
    count = int(chance.integers(1, 5))
    return PAIR.with_(
        **{
            "name": f"row-{seed}",
            "cavity.length_mm": length,
            "cavity.width_mm": max(width, 6.5 * count),
            "mold.outer_length_mm": length + 14.0,
            "mold.outer_width_mm": max(width, 6.5 * count) + 14.0,
            CLEAR: clear,
            "emitters.part": emitter,
            "receivers.part": receiver,
            HEIGHTS[0]: round(float(chance.uniform(1.5, clear - 0.5)), 1),
            HEIGHTS[1]: round(float(chance.uniform(1.5, clear - 0.5)), 1),
            "layout": [{"pattern": "facing_rows", "count": count, "pitch_mm": 6.35 if count > 1 else None}],
            "indenter.tip_radius_mm": tip,
            "operating.workspace_margin_mm": tip,
            "operating.max_depth_mm": round(min(5.0, 0.6 * clear), 1),
        }
    )


def flat_disc() -> SensorDesign:
    """The fingertip dome with a flat top, in an open mold."""
    document = DOME.model_dump(mode="json") | {"crown": None}
    document["cavity"] |= {"clear_thickness_mm": 6.0}
    document["mold"] |= {"rim_mm": 1.5}
    return SensorDesign.model_validate(document).with_(**{HEIGHTS[0]: 4.0, HEIGHTS[1]: 4.2})


def random_pad(shape: str, seed: int) -> SensorDesign:
    """A small pad of few parts, of one of `SHAPES`."""
    chance = np.random.default_rng([2, SHAPES.index(shape), seed])
    long, short = (round(float(chance.uniform(*of)), 0) for of in ((24.0, 36.0), (18.0, 26.0)))
    rim, sunk = float(chance.uniform(4.0, 9.0)), 0.0
    if shape == "dome":
        radius = DOME.crown.radius_mm
        rim, sunk = 0.7 * rim, radius - math.sqrt(radius**2 - (short / 2) ** 2)
    clear = round(rim + sunk, 1)
    heights = [round(float(share) * rim, 1) for share in chance.uniform(0.3, 0.8, 2)]
    changes = {"name": f"pad-{shape}-{seed}", CLEAR: clear, HEIGHTS[0]: heights[0], HEIGHTS[1]: heights[1]}
    if shape == "rectangle":
        return PAD.with_(
            **changes,
            **{
                "cavity.length_mm": long,
                "cavity.width_mm": short,
                "mold.outer_length_mm": long + 12.0,
                "mold.outer_width_mm": short + 12.0,
                "layout": [{"pattern": "alternating_ring", "parts_per_side": 2, "pitch_mm": 9.0}],
            },
        )
    base = flat_disc() if shape == "disc" else DOME
    return base.with_(
        **changes,
        **{
            "cavity.diameter_mm": short,
            "mold.outer_diameter_mm": short + 14.0,
            "layout": [{"pattern": "disc_ring", "count": int(chance.integers(3, 5))}],
        },
    )


def bad_designs(make: Any, count: int, name: str) -> list[SensorDesign]:
    """The first designs that break no rule and have a deadband by score; their seeds are kept."""
    file = FOLDER / f"{name}-seeds.json"
    known = json.loads(file.read_text()) if file.is_file() else {"bad": [], "next": 0}
    while len(known["bad"]) < count:
        seed = known["next"]
        known["next"] += 1
        try:
            design = make(seed)
        except OptopadError:
            continue
        if any(one.severity == "error" for one in check(design)):
            continue
        if verdict_of(design).verdict == "DEADBAND":
            known["bad"].append(seed)
            print(name, "bad", seed, len(known["bad"]), flush=True)
        write_text_atomically(file, json.dumps(known))
    return [make(seed) for seed in known["bad"][:count]]


def judged_of(found: dict[str, Any]) -> Judged:
    """A score's figures, as `betters` reads them."""
    sound = found["verdict"] == "CONTIGUOUS" and not found["is_open"]
    names = ("deadband_mm", "usable_depth_mm", "margin")
    return Judged(
        figures={name: found[name] for name in names},
        verdict=found["verdict"] if sound else "DEADBAND",
        may_be=sound,
    )


def plain(found: ContinuityScore) -> dict[str, Any]:
    return {
        "verdict": found.verdict,
        "deadband_mm": found.deadband_total_mm,
        "usable_depth_mm": found.usable_depth_mm,
        "margin": found.margin,
        "is_open": found.is_open,
    }


def improved(design: SensorDesign) -> dict[str, Any]:
    """What improve says of a design, and what score says of that."""
    file = FOLDER / f"{design.name}.json"
    if file.is_file():
        return dict(json.loads(file.read_text()))
    made = improve(design, out=FOLDER)
    offered = []
    for one in made.alternatives:
        again = verdict_of(load_design(made.folder / one.file))
        offered.append(
            {"kind": one.kind, "changes": one.changes, "said": plain(one.score), "scored": plain(again)}
            | {"robust": is_robust(one.score)}
        )
    found: dict[str, Any] = {
        "name": design.name,
        "before": plain(made.before.found),
        "tried": made.tried,
        "judged_again": made.judged_again,
        "offered": offered,
    }
    write_text_atomically(file, json.dumps(found, indent=1))
    print(design.name, [(one["kind"], one["scored"]) for one in offered], flush=True)
    return found


def grid(design: SensorDesign) -> dict[str, Any]:
    """The best of a grid over both heights and the thickness, the best first."""
    file = FOLDER / f"{design.name}-grid.json"
    if file.is_file():
        return dict(json.loads(file.read_text()))
    space = improvement_space(
        design, vary={}, keep=(), more_parts=False, trials=1, seed=0, figures=("margin", "resolvable_steps")
    )
    fields = {field.path: field for field in space.fields}
    layers = np.linspace(fields[CLEAR].low, fields[CLEAR].high, GRID).round(2)
    contiguous = (Limit(figure="verdict", equals="CONTIGUOUS"),)
    tried = []
    points = [  # no height above its layer, which a rule refuses
        (*heights, clear)
        for clear in layers
        for heights in itertools.product(
            *(np.linspace(fields[p].low, min(fields[p].high, clear), GRID).round(2) for p in HEIGHTS)
        )
    ]
    for point in points:
        try:
            changed = design.with_(**dict(zip((*HEIGHTS, CLEAR), map(float, point), strict=True)))
        except OptopadError:
            continue
        if not _is_broken(changed):
            tried.append((judge(changed, contiguous, wanted=("margin",)), changed))
    tried.sort(key=lambda one: worth(one[0]), reverse=True)
    safe = [one for one in tried if is_sound(one[0])]
    best = {one.digest: one for _, one in (*tried[:JUDGED_AGAIN], *safe[:JUDGED_AGAIN])}
    found = {"designs": len(tried), "best": [firmly(one) for one in best.values()]}
    write_text_atomically(file, json.dumps(found, indent=1))
    print(design.name, found, flush=True)
    return found


def firmly(design: SensorDesign) -> dict[str, Any]:
    """A score's figures and whether no unmeasured parameter changes its verdict; the design's three values."""
    score = verdict_of(design)
    if score.verdict == "CONTIGUOUS":
        score = with_tolerance(design, score, seed=0, on_step=lambda _stage, _share: None)
    at = [design.emitters.height_mm, design.receivers.height_mm, design.cavity.clear_thickness_mm]
    return plain(score) | {"robust": is_robust(score), "at": at}


def is_robust(score: ContinuityScore) -> bool:
    return score.tolerance is not None and not score.tolerance.flipping


def is_better(grid: dict[str, Any], offered: list[dict[str, Any]], *, firm: bool) -> bool:
    """Whether one of a grid's best designs is better than all that is offered.

    Parameters
    ----------
    firm : whether a design whose verdict an unmeasured parameter changes is worse than one without
    """
    return any(all(_beats(one, other, firm=firm) for other in offered) for one in grid["best"])


def _beats(one: dict[str, Any], other: dict[str, Any], *, firm: bool) -> bool:
    if not judged_of(one).may_be or (firm and one["robust"] < other["robust"]):
        return False
    if firm and one["robust"] > other["robust"]:
        return True
    was = judged_of(other["scored"])
    return betters(was, judged_of(one), "resolvable_steps", safe=DEADBAND_THRESHOLD)


def _is_broken(design: SensorDesign) -> bool:
    return any(one.severity == "error" for one in check(design))


def section(rows: list[dict[str, Any]], pads: list[dict[str, Any]]) -> str:
    """The part of the page, as far as designs are judged."""
    lines = [
        BEGIN,
        "## What improve proposes, and what it rejects",
        "",
        *summary(rows, pads),
        "",
        "| design | before | offered: usable mm, margin | robust | confirmed | best of the grid | grid better |",
        "|---|---|---|---|---|---|---|",
        *(table_row(one) for one in (*rows, *pads)),
        "",
        "Seeds are fixed, and designs with a deadband by `score` are taken in order. The grid has the ranges of "
        "improve.",
        "Margins are in noise units. `python -m tests.validation.verdict.improve_table`.",
        "",
        END,
    ]
    return "\n".join(lines)


def summary(rows: list[dict[str, Any]], pads: list[dict[str, Any]]) -> list[str]:
    both = [*rows, *pads]
    offered = [one for design in both for one in design["offered"]]
    kept = sum(one["said"] == one["scored"] for one in offered)
    firm = sum(is_better(one["grid"], one["offered"], firm=True) for one in rows)
    loose = sum(is_better(one["grid"], one["offered"], firm=False) for one in rows)
    none = sum(not one["offered"] for one in both)
    text = (
        f"The test has {len(rows)} random facing rows of one to four pairs and {len(pads)} small pads, all with a "
        f"deadband by `score`. `score` confirms the stated result of {kept} of {len(offered)} designs that improve "
        f"proposes; it proposes none for {none} of {len(both)}. A grid of up to {GRID**3} designs over both heights "
        f"and the thickness finds a better one, whose verdict is as robust, for {firm} of {len(rows)} rows. Without "
        f"regard to robustness it does for {loose}. These have more depth, and an unmeasured height of a component "
        "can give them a deadband."
    )
    return textwrap.wrap(text, WIDTH, break_on_hyphens=False)


def table_row(one: dict[str, Any]) -> str:
    offered = "; ".join(
        f"{x['said']['usable_depth_mm']:.1f}, {x['said']['margin']:.1f}" for x in one["offered"]
    )
    robust = sum(x["robust"] for x in one["offered"])
    same = sum(x["said"] == x["scored"] for x in one["offered"])
    best = max(one["grid"]["best"], key=lambda of: worth(judged_of(of))) if "grid" in one else None
    told = "-" if best is None else f"{best['usable_depth_mm']:.1f}, {best['margin']:.1f}"
    told += " (not robust)" if best is not None and not best["robust"] else ""
    better = "-"
    if "grid" in one:
        loose, firm = (is_better(one["grid"], one["offered"], firm=way) for way in (False, True))
        better = "yes" if firm else "if not robust" if loose else "no"
    count = len(one["offered"])
    before = f"{one['before']['verdict']}, margin {one['before']['margin']:.1f}"
    cells = [
        one["name"],
        before,
        offered or "none",
        f"{robust} of {count}",
        f"{same} of {count}",
        told,
        better,
    ]
    return "| " + " | ".join(cells) + " |"


def hand_pad() -> SensorDesign:
    """34 x 18 mm with 6 + 6 parts around it: 5 mm LEDs on their side, a Teensy, a tip of 2 mm."""
    return load_design(Path(__file__).with_name("hand_pad.toml"))


def by_score(design: SensorDesign) -> dict[str, Any]:
    """Verdict and the figure of each aim; a design out of the models' scope has none."""
    score = with_bounds(design, verdict_of(design))
    if score.verdict == "CONTIGUOUS":
        score = with_tolerance(design, score, seed=0, on_step=lambda _stage, _share: None)
    found = figures_of(design, score).to_json() | sizes_of(design) | {"margin": score.margin}
    figures = {name: found[name] for name, _, _ in FIGURES.values()}
    more = {"unresolved_share": found["unresolved_share"], "robust": is_robust(score)}
    return plain(score) | figures | more


def hand() -> None:
    """Judge the changes by hand and what improve offers in each aim, and write the section."""
    base, file = hand_pad(), FOLDER / "hand.json"
    known = json.loads(file.read_text()) if file.is_file() else {}
    for changes in HAND:
        key = "hand: " + (", ".join(f"{path} = {value:g}" for path, value in changes.items()) or "as given")
        if key not in known:
            known[key] = by_score(base.with_(**changes))
            write_text_atomically(file, json.dumps(known, indent=1))
            print(key, known[key], flush=True)
    for aim in FIGURES:
        key = f"improve --aim {aim}"
        if key not in known:
            made = improve(base, out=FOLDER, aim=aim)
            for one, path in zip(made.alternatives, made.files, strict=True):
                if one.kind.startswith(aim):
                    name = key.replace(aim, one.kind)
                    known[name] = by_score(load_design(path)) | {"changes": one.changes}
                    print(name, known[name], flush=True)
            write_text_atomically(file, json.dumps(known, indent=1))
    replaced(HAND_BEGIN, HAND_END, hand_section(known))


def hand_section(known: dict[str, Any]) -> str:
    rows = []
    for key, one in known.items():
        changed = ", ".join(f"{path} = {value}" for path, value in one.get("changes", {}).items())
        cells = [f"{key}: {changed}" if changed else key, one["verdict"]]
        cells += ["-" if one[name] is None else f"{one[name]:.3g}" for name, _, _ in FIGURES.values()]
        cells += [f"{100 * one['unresolved_share']:.0f} %", "yes" if one["robust"] else "no"]
        rows.append("| " + " | ".join(cells) + " |")
    by_hand = [
        one
        for key, one in known.items()
        if key.startswith("hand") and one["verdict"] == "CONTIGUOUS" and MARGIN not in key
    ]
    told = []
    for aim, (name, unit, sign) in FIGURES.items():
        offered = [one for key, one in known.items() if key.startswith(f"improve --aim {aim}")]
        if not offered:
            continue
        ours, best = (min(of, key=lambda one: sign * one[name]) for of in (offered, by_hand))
        is_as_good = sign * ours[name] <= sign * best[name] + 1e-9
        words = "improve is at least as good" if is_as_good else "**improve is worse**"
        told.append(f"{aim} {ours[name]:.3g} {unit} against {best[name]:.3g}: {words}")
    text = (
        "A pad for a gripper, 34 x 18 mm, with 6 + 6 parts around it, a layer of 5 mm, LEDs of 5 mm at 2.1 mm, "
        "photodiodes at 2.3 mm, a 12-bit board and a target of 300 counts. A user of a similar pad had found 17.2 "
        "sigma by hand (layer 5.5, 1200 counts, workspace margin 1.6 mm), 13.1 sigma at the given layer, and a "
        "location of 0.026 mm. All figures are those of `score`. The best that improve offers in each aim, against the "
        "best by hand at the given workspace margin: "
        + "; ".join(told)
        + f". A verdict is robust if no unmeasured parameter changes it: {sum(one['robust'] for one in by_hand)} of "
        f"{len(by_hand)} by hand. Improve offers a robust design first, and one that is better in the aim as "
        "*at risk*. Improve was developed with this pad: the figures say nothing about other pads."
    )
    heads = [
        "design",
        "verdict",
        *(f"{name} {unit}" for name, unit, _ in FIGURES.values()),
        "not resolved",
        "robust",
    ]
    lines = [
        HAND_BEGIN,
        "## A pad improved by hand",
        "",
        *textwrap.wrap(text, WIDTH, break_on_hyphens=False),
        "",
        "| " + " | ".join(heads) + " |",
        "|---" * len(heads) + "|",
        *rows,
        "",
        "`python -m tests.validation.verdict.improve_table hand`.",
        "",
        HAND_END,
    ]
    return "\n".join(lines)


def replaced(begin: str, end: str, section: str) -> None:
    """Write a section between its marks, or before the last sections of the page."""
    text = PAGE.read_text(encoding="utf-8")
    if begin in text:
        text = text[: text.index(begin)] + section + text[text.index(end) + len(end) :]
    else:
        text = text.replace("## What it means", section + "\n\n## What it means", 1)
    write_text_atomically(PAGE, text)


def main() -> None:
    """Judge what is left, and write the section."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    part = sys.argv[1] if len(sys.argv) > 1 else ""
    if part == "hand":
        hand()
        return
    bad_rows = [] if part == "pads" else bad_designs(random_row, ROWS, "rows")
    shapes = [] if part in ("rows", "grids") else SHAPES
    bad_pads = [one for of in shapes for one in bad_designs(partial(random_pad, of), PADS, f"{of}-pads")]
    grids = [grid(one) for one in bad_rows]
    rows = (
        []
        if part == "grids"
        else [improved(one) | {"grid": of} for one, of in zip(bad_rows, grids, strict=True)]
    )
    pads = [improved(one) for one in bad_pads]
    if part:
        return
    replaced(BEGIN, END, section(rows, pads))


if __name__ == "__main__":
    main()

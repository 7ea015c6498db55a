"""From a layout to better ones: a search around it, and what is worth having judged as `optopad score` judges.

outputs/improve-<name>-<digest8>/
  study.db, designs.csv, front.*, designs/, report.html   of the search (`optopad.jobs.exploration`)
  1-fewest-changes.toml ...    the alternatives: the design file as it was, changed lines marked
  improve.json                 before and alternatives, with their scores
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from design.errors import InputError
from design.fields.paths import get_at, known_paths, set_at
from design.geometry.cavity import cavity_of
from design.geometry.pairs import is_facing_rows
from design.geometry.plan import plan_of
from design.io import dump_design, load_design, write_text_atomically
from design.rules.check import require_valid
from design.search.explore import OnTried
from design.search.improve import (
    MOST_A_ROUND,
    MOVES,
    Range,
    first_points,
    improvement_space,
    picks,
    refinements,
)
from design.search.space import SearchSpace
from design.spec import SensorDesign
from design.spec.cheap_fields import CLEAR, HEIGHTS
from optopad.jobs.exploration import search
from optopad.jobs.judged_again import PLACE, JudgedAgain
from optopad.report.search import search_page
from optopad.results.improvement import Improvement
from optopad.results.search_result import Search
from sims.continuity.field_steps import with_field_steps
from sims.continuity.result import ContinuityScore

OnStep = Callable[[str, float], None]
PAD_MINUTES, ROW_MINUTES = 3.0, 1.0
"""Budgets of a pad and of facing rows by default [min on two cores]."""
CORES = 2
PAD_S, PAIR_S, ROW_S = 1.5, 0.04, 0.8
"""Processor time of a design of a pad: of any, and more a pair (measured on 16 to 64); of facing rows [s]."""
CURVED = 4.0
"""So many times more for a disc or a crowned pad."""
SEARCH = 0.4
"""Share of the budget that the search takes; scores take the rest [-]."""
FEWEST, MOST = 12, 400
"""Designs of a search at least and at most, before those around the best."""


def improve(
    design: SensorDesign,
    out: Path,
    *,
    text: str | None = None,
    vary: Mapping[str, Range | None] | None = None,
    keep: Sequence[str] = (),
    more_parts: bool = False,
    budget_min: float | None = None,
    seed: int = 0,
    on_step: OnStep | None = None,
    on_tried: OnTried | None = None,
) -> Improvement:
    """Search around a design, and judge what is worth having.

    Parameters
    ----------
    text : the design file, whose comments the alternatives keep; None writes it anew
    vary, keep, more_parts : as `design.search.improve.improvement_space` takes them
    budget_min : how long it may take about, on two idle cores [min]; None for the usual

    Raises
    ------
    InputError, DesignError : fields, ranges or a budget that are refused.
    """
    require_valid(design)
    facing = is_facing_rows(cavity_of(design))
    accuracy = "resolvable_steps" if facing else PLACE
    space = improvement_space(
        design,
        vary=vary or {},
        keep=keep,
        more_parts=more_parts,
        trials=trials_of(design, budget_min),
        seed=seed,
        figures=("margin", "resolvable_steps" if facing else "usable_depth_mm"),
    )
    again = JudgedAgain(space, accuracy, seed=seed, tell=on_step or (lambda _stage, _share: None))
    before = again.before
    if before.verdict == "OUT_OF_MODEL_SCOPE":
        raise InputError(
            f"{design.name}: {before.reason}; improve begins with a design that the models cover"
        )
    before = with_field_steps(design, before, seed=seed, on_step=again.tell)
    first = _first(space, before)
    found = search(
        space,
        out,
        trials=max(trials_of(design, budget_min), len(first) + 1),
        on_tried=on_tried,
        first=first,
        refine=lambda findings, number: refinements(space, findings.tried, number),
        also_mm=_deciding_places(before),
    )
    made = Improvement(
        design=design,
        before=before,
        figures=found.findings.base.figures,
        alternatives=(),
        nearest=None,
        tried=len(found.findings.tried),
        folder=found.folder,
        is_interrupted=found.findings.is_interrupted,
    )
    if made.is_interrupted:
        return made
    tried = again.found_by_search(found.findings.base, found.findings.tried)
    alternatives = again.alternatives(picks(space, again.base, tried, accuracy), tried)
    made = replace(
        made,
        figures=again.base.figures,
        alternatives=alternatives,
        nearest=None if alternatives else again.nearest(tried),
        judged_again=len(again.scores) - 1,
    )
    _write(made, found, text)
    return made


def trials_of(design: SensorDesign, budget_min: float | None) -> int:
    """Designs that a budget is enough for, by what a design of this size costs; the same on every machine."""
    cavity = cavity_of(design)
    facing = is_facing_rows(cavity)
    budget = (ROW_MINUTES if facing else PAD_MINUTES) if budget_min is None else budget_min
    if not 0.0 < budget <= 24 * 60:
        raise InputError(f"--budget: {budget:g} minutes is refused: give more than 0, up to 1440")
    pairs = len(cavity.emitters) * len(cavity.receivers)
    each_s = ROW_S if facing else PAD_S + PAIR_S * pairs
    each_s *= 1.0 if plan_of(design).is_flat_rectangle else CURVED
    around = len(MOVES) * MOST_A_ROUND
    return min(max(int(SEARCH * budget * 60.0 * CORES / each_s) - around, FEWEST), MOST)


def _first(space: SearchSpace, before: ContinuityScore) -> list[dict[str, Any]]:
    """Points to begin with: what the cause of the worst blind interval asks for, then what small steps gain."""
    cause = before.causes[0] if before.causes else None
    side = 0 if cause is None else {"apart": 1, "used up": -1}.get(cause.lack, 0)
    sides = {**dict.fromkeys(HEIGHTS[::-1], side), CLEAR: -side} if side else {}
    if before.steps is not None:
        sides |= {path: way for path, way in before.steps.better_sides().items() if path not in sides}
    short = None if cause is None else max(cause.short_mm or 2.0, 0.5)
    return first_points(space, sides=sides, short_mm=short)


def _deciding_places(before: ContinuityScore) -> list[tuple[float, float]]:
    """Where the verdict on a pad turns: its worst and its weakest place [mm]."""
    if before.pad_map is None or before.is_facing_rows:
        return []
    return list(dict.fromkeys((one.x_mm, one.y_mm) for one in (before.pad_map.worst, before.pad_map.weakest)))


def _write(made: Improvement, found: Search, text: str | None) -> None:
    """Design files, page and data; what an earlier run left of them goes."""
    if text is None:
        text = dump_design(made.design).split("\n", 1)[
            1
        ]  # its first line names a digest, which will be another
    _clear(made.folder, keep={one.file for one in made.alternatives})
    for one in made.alternatives:
        _write_design(made.folder / one.file, text, made.design, one.changes, one.kind)
    write_text_atomically(made.folder / "report.html", search_page(found, made))
    write_text_atomically(made.folder / "improve.json", json.dumps(made.to_json(), indent=2) + "\n")


def _clear(folder: Path, *, keep: set[str]) -> None:
    """Remove the alternatives of an earlier run, which its improve.json names; files of the user's own stay."""
    try:
        earlier = json.loads((folder / "improve.json").read_text(encoding="utf-8"))["alternatives"]
        names = {Path(one["file"]).name for one in earlier}
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in names - keep:
        (folder / name).unlink(missing_ok=True)


def _write_design(file: Path, text: str, base: SensorDesign, changes: Mapping[str, Any], kind: str) -> None:
    """The design file with its comments; changed lines say what they were."""
    import tomlkit

    document, was, known = tomlkit.parse(text), base.model_dump(mode="json"), known_paths(SensorDesign)
    for path, value in changes.items():
        item = tomlkit.item(value)
        item.comment(f"was {get_at(was, path)!r}; improve: {kind}")
        set_at(document, path, item, known=known)
    write_text_atomically(file, tomlkit.dumps(document))
    load_design(file)

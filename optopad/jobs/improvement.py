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
from design.io import dump_design, load_design, write_text_atomically
from design.rules.check import require_valid
from design.search.explore import OnTried
from design.search.improve import (
    KINDS,
    Pick,
    Range,
    changes_of,
    first_points,
    improvement_space,
    picks,
)
from design.search.judged import Tried
from design.search.space import SearchSpace
from design.spec import SensorDesign
from design.spec.cheap_fields import CLEAR, HEIGHTS
from optopad.jobs.exploration import search
from optopad.report.search import search_page
from optopad.results.improvement import Alternative, Improvement, Nearest
from optopad.results.search_result import Search
from sims.continuity.build_tolerance import with_tolerance
from sims.continuity.field_steps import with_field_steps
from sims.continuity.result import ContinuityScore
from sims.continuity.scoring import score

OnStep = Callable[[str, float], None]
PAD_MINUTES, ROW_MINUTES = 3.0, 1.0
"""Budgets of a pad and of facing rows by default [min on two cores]."""
CORES = 2
PAD_S, PAIR_S, ROW_S = 10.0, 0.08, 2.0
"""Processor time of a design of a pad: of any, and more a pair (measured on 36 to 144); of facing rows [s]."""
BLIND_SHARE = 0.45
"""Share of it around a pad with a deadband, where many designs are given up at the map [-]."""
PAD_SEARCH, ROW_SEARCH = 0.4, 0.65
"""Shares of the budget that the search takes; scores take the rest [-]."""
FEWEST, MOST = 6, 400
"""Designs of a search at least and at most."""
ATTEMPTS = 2
"""Designs of a kind that are judged again before the kind is given up."""


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
    figures = ("margin", "resolvable_steps" if facing else "location_bound_mm")
    space = improvement_space(
        design,
        vary=vary or {},
        keep=keep,
        more_parts=more_parts,
        trials=trials_of(design, budget_min, is_blind=True),
        seed=seed,
        figures=figures,
    )
    tell = on_step or (lambda _stage, _share: None)
    before = score(design, verdict_only=True, seed=seed, on_step=tell)
    if before.verdict == "OUT_OF_MODEL_SCOPE":
        raise InputError(
            f"{design.name}: {before.reason}; improve begins with a design that the models cover"
        )
    before = with_field_steps(design, before, seed=seed, on_step=tell)
    found = search(
        space,
        out,
        trials=trials_of(design, budget_min, is_blind=before.verdict == "DEADBAND"),
        on_tried=on_tried,
        first=_first(space, before),
        also_mm=_deciding_places(before),
    )
    tried, base = found.findings.tried, found.findings.base
    made = Improvement(
        design=design,
        before=before,
        figures=base.figures,
        alternatives=(),
        nearest=None,
        tried=len(tried),
        folder=found.folder,
        is_interrupted=found.findings.is_interrupted,
    )
    if made.is_interrupted:
        return made
    base = replace(base, verdict=before.verdict)  # a score sees deadbands that a quick map misses
    alternatives = _alternatives(space, picks(space, base, tried, figures[1]), seed, tell)
    nearest = None if alternatives else _nearest(space, tried)
    made = replace(made, alternatives=alternatives, nearest=nearest)
    _write(made, found, text)
    return made


def trials_of(design: SensorDesign, budget_min: float | None, *, is_blind: bool) -> int:
    """Designs that a budget is enough for, by what a design of this size costs; the same on every machine."""
    cavity = cavity_of(design)
    facing = is_facing_rows(cavity)
    budget = (ROW_MINUTES if facing else PAD_MINUTES) if budget_min is None else budget_min
    if not 0.0 < budget <= 24 * 60:
        raise InputError(f"--budget: {budget:g} minutes is refused: give more than 0, up to 1440")
    pairs = len(cavity.emitters) * len(cavity.receivers)
    share = ROW_SEARCH if facing else PAD_SEARCH
    each_s = ROW_S if facing else (PAD_S + PAIR_S * pairs) * (BLIND_SHARE if is_blind else 1.0)
    return min(max(int(share * budget * 60.0 * CORES / each_s), FEWEST), MOST)


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


def _alternatives(
    space: SearchSpace, wanted: Sequence[Pick], seed: int, tell: OnStep
) -> tuple[Alternative, ...]:
    """Of every kind the first that keeps its promise at score accuracy, different from the others."""
    found: list[Alternative] = []
    judged: dict[str, ContinuityScore] = {}
    for kind in KINDS:
        for one in [pick.tried for pick in wanted if pick.kind == kind][:ATTEMPTS]:
            changed = space.changed(one.parameters)
            if changed.digest not in judged:
                tell(kind, 0.0)
                judged[changed.digest] = _scored(changed, seed, tell)
            scored = judged[changed.digest]
            if not _is_sound(scored):
                continue
            if any(other.design.digest == changed.digest for other in found):
                break
            found.append(
                Alternative(
                    kind=kind,
                    changes=changes_of(space, one.parameters),
                    design=changed,
                    file=f"{len(found) + 1}-{kind.replace(' ', '-')}.toml",
                    figures=one.judged.figures,
                    score=scored,
                )
            )
            break
    return tuple(found)


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


def _scored(design: SensorDesign, seed: int, tell: OnStep) -> ContinuityScore:
    """The verdict as `optopad score` gives it, open values tried; bounds are left to the search."""
    found = score(design, verdict_only=True, seed=seed, on_step=tell)
    return with_tolerance(design, found, seed=seed, on_step=tell) if _is_sound(found) else found


def _is_sound(found: ContinuityScore) -> bool:
    return found.verdict == "CONTIGUOUS" and not found.is_open


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


def _nearest(space: SearchSpace, tried: Sequence[Tried]) -> Nearest | None:
    judged = [one for one in tried if one.judged.figures.get("deadband_mm") is not None]
    if not judged:
        return None
    best = min(
        judged,
        key=lambda one: (
            one.judged.figures["deadband_mm"],
            -(one.judged.figures.get("margin") or 0.0),
            one.number,
        ),
    )
    ends = tuple(
        field.path
        for field in space.fields
        if field.low is not None and float(best.parameters[field.path]) in (field.low, field.high)
    )
    return Nearest(changes=changes_of(space, best.parameters), judged=best.judged, at_ends=ends)

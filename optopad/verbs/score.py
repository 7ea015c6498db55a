"""Computes the verdict on a design: modes, deadbands, continuity, strength and a map of the pad."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.bundle_parts import ANSWER, answer_parts, scored, write_pages
from optopad.cli.verb import Asked, typed, verb
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.io import write_text_atomically
from optopad.design.pad import Pad
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, current_files
from optopad.screen.answer import Answer, labelled, learner_words
from optopad.screen.held import object_lines
from optopad.screen.output import Told, foretell_score
from optopad.screen.score import Score
from optopad.screen.shear import shear_lines
from optopad.screen.touches import touch_lines
from optopad.sims.held_score import OBJECTS, require_objects, score_objects
from optopad.sims.learning.inference.two_touches import require_one_or_two
from optopad.sims.score import scoring
from optopad.sims.score.build_tolerance import DEFAULT_BUILDS
from optopad.sims.score.result import ContinuityScore
from optopad.sims.shear_score import SHEAR, require_shear, score_shear
from optopad.sims.touches_score import TOUCHES, require_touches, score_touches
from optopad.sims.verdict.builds import FEWEST_BUILDS, MOST_BUILDS
from optopad.work import OUT, FinishedWork, beside


def score(
    design: SensorDesign,
    *,
    fine: bool = False,
    full: bool = False,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> Score:
    """Compute the verdict on a design, with its figures, maps and plots; nothing is written.

    Parameters
    ----------
    full : whether to compute the map at 11 locations along the longer side and in depth steps of 0.1 mm
    fine : whether to compute the map as with `full`, and also with finer settings of the light model
    seed : seed of the random shifts of the light model

    Raises
    ------
    DesignError : the design breaks a rule; `check` lists them.
    """
    found = scoring.score(design, fine=fine, full=full, seed=seed, on_step=on_step)
    return Score(design=design, found=found)


@dataclass(frozen=True, kw_only=True)
class _More:
    """Figures that a score computes only if asked.

    Attributes
    ----------
    name : name in the data for JSON
    require : refuses a pad that is not modelled, before any work
    score : computes the figures
    lines : shows their data on the screen
    file : file in the bundle's folder `sims`
    """

    name: str
    require: Callable[[Pad], None]
    score: Callable[..., Any]
    lines: Callable[[dict[str, Any]], list[str]]
    file: str


MORE = (
    _More(name="objects", require=require_objects, score=score_objects, lines=object_lines, file=OBJECTS),
    _More(name="shear", require=require_shear, score=score_shear, lines=shear_lines, file=SHEAR),
    _More(name="touches", require=require_touches, score=score_touches, lines=touch_lines, file=TOUCHES),
)


@verb(touches=typed("N"))
def score_command(
    design: SensorDesign,
    *,
    full: bool = False,
    fine: bool = False,
    tolerance: bool = False,
    builds: int | None = None,
    objects: bool = False,
    shear: bool = False,
    touches: int = 1,
    out: Path = Path(OUT),
    seed: int = 0,
    details: bool = False,
    as_json: bool = False,
    on_step: OnStep,
    asked: Asked,
) -> Told:
    """Report the verdict: modes, deadbands, continuity, strength and a map of the pad, written into the bundle.

    Parameters
    ----------
    full : A map of 11 locations per side with steps of 0.1 mm, with the usual light.
    tolerance : Also run a Monte Carlo over all tolerances and report how many units keep the verdict.
    builds : Units of the Monte Carlo of --tolerance (200 if left out).
    objects : Also report how well the pad distinguishes ball, cylinder, edge, face and corner.
    shear : Also report how well the pad resolves sideways load, and what it does to models without it.
    touches : 2: also report how near two touches may be before they look like one.
    """
    drawn = _drawn_builds(tolerance, builds)
    require_one_or_two(touches)
    pad = Pad.of(design)
    foretell_score(pad, fine=fine, full=full, quiet=as_json)
    more = [one for one, is_asked in zip(MORE, (objects, shear, touches > 1), strict=True) if is_asked]
    for one in more:
        one.require(pad)
    found, folder, added = _written(
        pad, out, fine=fine, full=full, seed=seed, on_step=on_step, builds=drawn, more=more
    )
    answer, files = Answer.read(folder / ANSWER), labelled("files", str(folder))
    files_too = [*(line for one in more for line in one.lines(added[one.name])), files]
    if details:
        lines = [*answer.details, labelled("size", answer.size), *files_too]
    else:
        learner = learner_words(folder, design.digest)
        lines = answer.lines(files_too, command=asked.words, learner=learner)
    return Told(found.to_json() | added, lines)


def _drawn_builds(tolerance: bool, builds: int | None) -> int | None:
    if not tolerance:
        if builds is not None:
            raise InputError("--builds: needs --tolerance, whose units it counts; add it")
        return None
    drawn = DEFAULT_BUILDS if builds is None else builds
    if not FEWEST_BUILDS <= drawn <= MOST_BUILDS:
        raise InputError(f"--builds: {drawn} is refused: give {FEWEST_BUILDS} to {MOST_BUILDS}")
    return drawn


def _written(
    pad: Pad,
    out: Path,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
    full: bool = False,
    builds: int | None = None,
    more: Sequence[_More] = (),
) -> tuple[ContinuityScore, Path, dict[str, Any]]:
    """Write verdict, map and the map's signals into the bundle; the score, the bundle's folder, and data of `more`."""
    design, name = pad.design, bundle_name(pad.design)
    has_page = (out / name / "report.html").exists()  # a bundle has one verdict: its page is made anew
    contact, answer = answer_parts(design, seed, fine=fine, full=full, builds=builds, has_page=has_page)
    memo = None if builds is None else FinishedWork(out, f"{name}.builds", [design.digest, seed])
    with (
        bundle(design, out, seed=seed, parts=(contact, answer)) as folder,
        beside("optopad.report") as drawer,
    ):
        score, drawn = scored(
            design,
            folder,
            drawer,
            fine=fine,
            full=full,
            seed=seed,
            on_step=on_step,
            with_page=has_page,
            done=current_files(folder, contact),
            builds=builds,
            memo=memo,
        )
        drawn()
        added = {one.name: _added(one, pad, folder, score, seed, on_step) for one in more}
        if has_page:
            write_pages(design, folder, score, seed, drawer)
    if memo is not None:
        memo.forget()
    return score, out / name, added


def _added(
    one: _More, pad: Pad, folder: Path, score: ContinuityScore, seed: int, on_step: OnStep
) -> dict[str, Any]:
    """Compute and write figures beside the verdict; if models or learners refuse, return only the reason."""
    if score.readout is None:
        return {"refused": "the models give no verdict on this design"}
    try:
        found: dict[str, Any] = one.score(pad, seed=seed, on_step=on_step).to_json()
    except (InputError, ModelScopeError) as err:
        return {"refused": str(err)}
    write_text_atomically(folder / "sims" / one.file, json.dumps(found, indent=2) + "\n")
    return found

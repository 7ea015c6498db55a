"""Makes the whole bundle of a design: mold, verdict, sheets, firmware, driver configuration, report."""

from __future__ import annotations

import json
import sys
from os import PathLike
from pathlib import Path

from optopad.cli.verb import Asked, verb
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.jobs import pipeline
from optopad.screen.answer import Answer, checks_words, labelled, learner_words, row
from optopad.screen.bundle import Bundle
from optopad.screen.output import Told, foretell_score
from optopad.work import OUT


def run(
    design: SensorDesign,
    *,
    fine: bool = False,
    seed: int = 0,
    force: bool = False,
    out: str | PathLike[str] = OUT,
    on_step: OnStep | None = None,
) -> Bundle:
    """Make the whole bundle: mold, verdict, sheets, firmware, driver configuration, report.

    Parameters
    ----------
    force : whether to make parts again that the bundle has from the same inputs

    Raises
    ------
    DesignError : the design breaks a rule.
    OutputError : the folder cannot be written.
    """
    return pipeline.run(design, Path(out), fine=fine, seed=seed, force=force, on_step=on_step or silent)


@verb()
def run_command(
    design: SensorDesign,
    *,
    fine: bool = False,
    force: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    details: bool = False,
    as_json: bool = False,
    on_step: OnStep,
    asked: Asked,
) -> Told:
    """Make mold, verdict, driver configuration and report of a design in one bundle.

    Parameters
    ----------
    force : Make parts again that are up to date.
    """
    made = pipeline.run(
        design,
        out,
        fine=fine,
        seed=seed,
        force=force,
        on_start=lambda: foretell_score(design, fine=fine, full=False, quiet=as_json, is_run=True),
        on_step=on_step,
    )
    if as_json:
        score = json.loads((made.folder / "sims" / "score.json").read_text(encoding="utf-8"))
        return Told({"bundle": str(made.folder), "checks_ok": made.checks["ok"], "score": score}, ())
    for name in made.mended:
        print(f"{name} was changed or removed after the run that made it: made again", file=sys.stderr)
    if made.is_current:
        print("up to date: nothing changed since the run that made this bundle", file=sys.stderr)
    answer = Answer.read(made.folder / "sims" / "answer.json")
    page, mold = labelled("report", str(made.report)), checks_words(made.checks)
    if details:
        return Told({}, [*answer.details, labelled("size", answer.size), labelled("mold", mold), page])
    learner, closing = learner_words(made.folder, design.digest), [*row("mold", mold, 2), page]
    return Told({}, answer.lines(closing, command=asked.words, is_built=True, learner=learner))

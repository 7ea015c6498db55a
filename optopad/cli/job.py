"""Commands for the whole bundle and its report page: run, report."""

from __future__ import annotations

from optopad.cli import options
from optopad.screen.output import foretell_score, progress, tell
from optopad.work import read_design


def run(
    design: options.Design,
    set_: options.Set = None,
    fine: options.Fine = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    details: options.Details = False,
    as_json: options.Json = False,
) -> None:
    """Make mold, verdict, driver configuration and report of a design in one bundle."""
    from optopad.jobs.pipeline import run as make
    from optopad.screen.figures import summary_words
    from optopad.screen.verdict import (
        as_typed,
        checks_words,
        labelled,
        learner_line,
        row,
        score_lines,
        verdict_screen,
    )

    read = read_design(design, set_)
    foretell_score(read, fine=fine, full=False, quiet=as_json, is_run=True)
    with progress(quiet=as_json) as step:
        made = make(read, out, fine=fine, seed=seed, on_step=step)
    place = {"bundle": str(made.folder), "checks_ok": made.checks["ok"]}
    page, typed = labelled("report", str(made.folder / "report.html")), as_typed(design, set_)
    mold, size = checks_words(made.checks), summary_words(read, made.score.found)
    tell(
        as_json,
        lambda: place | {"score": made.score.to_dict()},
        lambda: (
            [*score_lines(made.score.found), labelled("size", size), labelled("mold", mold), page]
            if details
            else verdict_screen(
                read,
                made.score.found,
                [*row("mold", mold, 2), page],
                command=typed,
                is_built=True,
                learner=learner_line(read, made.folder, typed),
                size=size,
            )
        ),
    )

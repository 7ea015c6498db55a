"""Commands for the whole bundle and its report page: run, report."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.screen.output import foretell_score, print_json, progress, say
from optopad.work import read_design


def run(
    design: options.Design,
    set_: options.Set = None,
    fine: options.Fine = False,
    force: Annotated[bool, typer.Option("--force", help="Make parts again that are up to date.")] = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    details: options.Details = False,
    as_json: options.Json = False,
) -> None:
    """Make mold, verdict, driver configuration and report of a design in one bundle."""
    from optopad.jobs.pipeline import run as make
    from optopad.screen.answer import Answer, as_typed, checks_words, labelled, learner_words, row

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        made = make(
            read,
            out,
            fine=fine,
            seed=seed,
            force=force,
            on_start=lambda: foretell_score(read, fine=fine, full=False, quiet=as_json, is_run=True),
            on_step=step,
        )
    if as_json:
        score = json.loads((made.folder / "sims" / "score.json").read_text(encoding="utf-8"))
        print_json({"bundle": str(made.folder), "checks_ok": made.checks["ok"], "score": score})
        return
    for name in made.mended:
        print(f"{name} was changed or removed after the run that made it: made again", file=sys.stderr)
    if made.is_current:
        print("up to date: nothing changed since the run that made this bundle", file=sys.stderr)
    answer, typed = Answer.read(made.folder / "sims" / "answer.json"), as_typed(design, set_)
    page, mold = labelled("report", str(made.report)), checks_words(made.checks)
    if details:
        lines = [*answer.details, labelled("size", answer.size), labelled("mold", mold), page]
    else:
        learner = learner_words(made.folder, read.digest)
        closing = [*row("mold", mold, 2), page]
        lines = answer.lines(closing, command=typed, is_built=True, learner=learner)
    say("\n".join(lines))


def report(
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Bundle folder of an earlier run.")],
    open_: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    as_json: options.Json = False,
) -> None:
    """Check every file of a bundle against its manifest and show the path of the report."""
    import webbrowser

    from optopad.design.errors import InputError
    from optopad.fabrication.bundle import MANIFEST, altered_files, with_other_line_ends

    page = bundle / "report.html"
    if not (bundle / MANIFEST).is_file() or not page.is_file():
        raise InputError(f"{bundle}: no bundle with a report; make one with `optopad run DESIGN`")
    altered = altered_files(bundle)
    rewrapped = with_other_line_ends(bundle, altered)
    if as_json:
        print_json({"report": str(page), "altered": list(altered), "line_ends": list(rewrapped)})
    else:
        say(f"report    {page}")
        if rewrapped:
            say(
                f"warning   {len(rewrapped)} files have other line ends than the run wrote, and the same content: git "
                "(core.autocrlf) or a copy by Windows changed them; put `* -text` into .gitattributes and check out "
                "again, or copy the folder as it is"
            )
        for name in sorted(set(altered).difference(rewrapped)):
            say(f"warning   {name} differs from the manifest: it was changed after the run")
    if open_:
        webbrowser.open(page.resolve().as_uri())

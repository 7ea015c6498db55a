"""Makes the whole bundle of a design: mold, verdict, sheets, firmware, driver configuration, report.

Only what changed is made. A mold and plots of the contact may also come from another bundle, since electronics and gain
do not change them. Light that was traced before is read from disk in any case.

Mold, physics and drawings run in parallel. The mold is made in a new process, because the CAD kernel does not survive a
fork; the plots are drawn in another. The physics runs in this process.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from optopad.bundle_parts import ANSWER, answer_parts, checks_of, mold_part, scored, write_pages
from optopad.cli.verb import Asked, verb
from optopad.design.errors import InputError, OutputError
from optopad.design.io import save_design, write_text_atomically
from optopad.design.pad import Pad
from optopad.design.progress import OnStep, silent
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import Part, altered_files, bundle, bundle_name, copy_part, current_files
from optopad.screen.answer import Answer, board_words, checks_words, labelled, learner_words, row
from optopad.screen.bundle import Bundle
from optopad.screen.output import Told, foretell_score
from optopad.work import OUT, beside, started

if TYPE_CHECKING:
    from optopad.sims.score.result import ContinuityScore

REFUSED = 2
"""Exit code of the mold's process if it refused the work with a message for the user."""


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
    return _made(design, Path(out), fine=fine, seed=seed, force=force, on_step=on_step or silent)


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
    made = _made(
        design,
        out,
        fine=fine,
        seed=seed,
        force=force,
        on_start=lambda: foretell_score(Pad.of(design), fine=fine, full=False, quiet=as_json, is_run=True),
        on_step=on_step,
    )
    if as_json:
        score = json.loads((made.folder / "sims" / "score.json").read_text(encoding="utf-8"))
        return Told({"bundle": str(made.folder), "checks_ok": made.checks["ok"], "score": score}, ())
    for name in made.mended:
        print(f"{name} was changed or removed after the run that made it: made again", file=sys.stderr)
    if made.is_current:
        print("up to date: nothing changed since the run that made this bundle", file=sys.stderr)
    answer = Answer.read(made.folder / ANSWER)
    page, mold, board = (
        labelled("report", str(made.report)),
        checks_words(made.checks),
        board_words(made.folder),
    )
    if details:
        return Told(
            {},
            [
                *answer.details,
                labelled("size", answer.size),
                labelled("mold", mold),
                *row("board", board, 99),
                page,
            ],
        )
    learner, closing = (
        learner_words(made.folder, design.digest),
        [*row("mold", mold, 2), *row("board", board, 3), page],
    )
    return Told({}, answer.lines(closing, command=asked.words, is_built=True, learner=learner))


def _made(
    design: SensorDesign,
    out: Path,
    *,
    fine: bool,
    seed: int,
    force: bool = False,
    on_start: Callable[[], None] = lambda: None,
    on_step: OnStep,
) -> Bundle:
    """The bundle; `on_start` is called before the verdict is computed."""
    require_valid(design)
    final = out / bundle_name(design)
    parts = mold, contact, _ = mold_part(design), *answer_parts(design, seed, fine=fine)
    kept = [[] if force else current_files(final, part) for part in parts]
    has_mold, plots, has_answer = bool(kept[0]), kept[1], bool(kept[1] and kept[2])
    altered = _altered(final)
    found: ContinuityScore | None = None
    if not all(kept) or "design.toml" in altered:
        with bundle(design, out, seed=seed, parts=parts) as folder:
            if not force:
                has_mold = has_mold or _copied_mold(design, mold, folder, out)
                plots = plots or copy_part(contact, folder, out, design.name)
            with (
                nullcontext() if has_mold else _mold_beside(design, folder) as process,
                nullcontext() if has_answer else beside("optopad.report") as drawer,
            ):
                if drawer is not None:
                    on_start()
                    found, drawn = scored(
                        design,
                        folder,
                        drawer,
                        fine=fine,
                        seed=seed,
                        on_step=on_step,
                        with_page=True,
                        done=plots,
                    )
                if process is not None:
                    on_step("mold beside", 0.0)
                    _finish(process)
                    on_step("mold beside", 1.0)
                if found is not None and drawer is not None:
                    on_step("files", 0.0)
                    drawn()
                    write_pages(design, folder, found, seed, drawer)
                    on_step("files", 1.0)
    fresh = [part for part, files in zip(parts, kept, strict=True) if not files]
    made = {"design.toml"}.union(*(current_files(final, part) for part in fresh))
    return Bundle(
        design=design,
        folder=final,
        checks=checks_of(final / "cad"),
        found=found,
        fine=fine,
        seed=seed,
        is_current=all(kept),
        mended=tuple(name for name in altered if name in made),
    )


def _altered(folder: Path) -> tuple[str, ...]:
    """Files of a bundle that were changed or removed after a command wrote them; none if there is no bundle."""
    try:
        return altered_files(folder)
    except InputError:
        return ()


def _copied_mold(design: SensorDesign, mold: Part, folder: Path, out: Path) -> bool:
    """Whether the mold could be taken from another bundle; its checks then name this design."""
    if not copy_part(mold, folder, out, design.name):
        return False
    checks = checks_of(folder / "cad") | {"digest": design.digest}
    write_text_atomically(folder / "cad" / "checks.json", json.dumps(checks, indent=2) + "\n")
    return True


@contextmanager
def _mold_beside(design: SensorDesign, folder: Path) -> Iterator[subprocess.Popen[str]]:
    (folder / "cad").mkdir(exist_ok=True)
    save_design(design, folder / "design.toml")
    process = started(["-m", "optopad.cad", str(folder / "design.toml"), str(folder / "cad")])
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def _finish(mold: subprocess.Popen[str]) -> None:
    """Wait for the process that makes the mold.

    Raises
    ------
    OutputError, RuntimeError : the process refused the work or failed; the error has the process's message.
    """
    _, message = mold.communicate()
    if mold.returncode == REFUSED:
        raise OutputError(message.strip())
    if mold.returncode != 0:
        raise RuntimeError(f"the mold's process ended with {mold.returncode}: {message.strip()}")

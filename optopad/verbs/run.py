"""Makes the whole bundle of a design: mold, verdict, sheets, firmware, driver configuration, report."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from optopad.cli.verb import Asked, verb
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.jobs import pipeline
from optopad.screen.output import Told, foretell_score
from optopad.screen.score import Bundle
from optopad.work import OUT


def run(
    design: SensorDesign,
    *,
    fine: bool = False,
    seed: int = 0,
    out: str | PathLike[str] = OUT,
    on_step: OnStep | None = None,
) -> Bundle:
    """Make the whole bundle: mold, verdict, sheets, firmware, driver configuration, report.

    Raises
    ------
    DesignError : the design breaks a rule.
    OutputError : the folder cannot be written.
    """
    return pipeline.run(design, Path(out), fine=fine, seed=seed, on_step=on_step or silent)


@verb()
def run_command(
    design: SensorDesign,
    *,
    fine: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    details: bool = False,
    as_json: bool = False,
    on_step: OnStep,
    asked: Asked,
) -> Told:
    """Make mold, verdict, driver configuration and report of a design in one bundle."""
    foretell_score(design, fine=fine, full=False, quiet=as_json, is_run=True)
    made = run(design, fine=fine, seed=seed, out=out, on_step=on_step)
    return Told(made.to_json(), made.screen(asked.words, details=details))

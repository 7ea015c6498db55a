"""Parts of a bundle that several verbs write: the verdict, and the sheets and the report that follow from it.

A part that a bundle already has from the same inputs is not made again (`optopad.fabrication.bundle.Part`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optopad.design.io import write_text_atomically
from optopad.design.parts.assumptions import Bed
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import Part, program_digest
from optopad.work import FinishedWork, OtherProcess

if TYPE_CHECKING:
    from optopad.fabrication.gain import SimulatedGain
    from optopad.fabrication.sheets.bom import BomRow
    from optopad.fabrication.sheets.prices import Price, PriceKey
    from optopad.sims.score.result import ContinuityScore

ANSWER = Path("sims", "answer.json")
"""File of a bundle with the texts of the screen (`optopad.screen.answer`)."""

CONTACT_PLOTS = (
    "layout",
    "force",
    "contact-radius",
    "force-near",
    "load-protocol",
    "load-time",
    "map-by-depth-load",
)
"""Plots of a report's page that show the pad's shape and the load of a press."""


def mold_part(design: SensorDesign, bed_mm: Bed | None = None, *, slice_parts: bool = False) -> Part:
    """The mold and its tools as a part of a bundle; the settings are those of `optopad build`."""
    inputs = {"mold": design.mold_digest, "bed_mm": bed_mm, "slice_parts": slice_parts}
    return Part(inputs | {"program": program_digest()}, ("cad/",))


def answer_parts(
    design: SensorDesign,
    seed: int,
    *,
    fine: bool = False,
    full: bool = False,
    builds: int | None = None,
    has_page: bool = True,
) -> tuple[Part, Part]:
    """Two parts of a bundle: plots of the pad's shape and of a press's load; the verdict and what follows from it.

    Parameters
    ----------
    fine, full, builds : settings of the score
    has_page : whether the report, the sheets and the firmware are made, too
    """
    settings = {"fine": fine, "full": full}
    shape = settings | {"surface": design.surface_digest, "measured": sorted(design.measured)}
    whole = settings | {"design": design.digest, "seed": seed, "builds": builds, "has_page": has_page}
    plots = tuple(f"sims/plot-{name}.svg" for name in CONTACT_PLOTS)
    program = {"program": program_digest()}
    return Part(shape | program, plots), Part(whole | program, ("sims/", "fabrication/", "report.html"))


def checks_of(folder: Path) -> dict[str, Any]:
    """The checks of the mold in the folder of its files."""
    checks: dict[str, Any] = json.loads((folder / "checks.json").read_text(encoding="utf-8"))
    return checks


def mold_mm3(checks: dict[str, Any]) -> float:
    """Volume of the mold's solid, from its checks [mm3]."""
    return float(checks["volumes_mm3"]["mold"]["solid"])


def scored(
    design: SensorDesign,
    folder: Path,
    drawer: OtherProcess,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
    with_page: bool,
    done: Sequence[str] = (),
    full: bool = False,
    builds: int | None = None,
    memo: FinishedWork | None = None,
) -> tuple[ContinuityScore, Callable[[], None]]:
    """Compute and write the score.

    Meanwhile, the other process makes what does not depend on the tolerances: files, and drawings for `write_pages`.
    The returned function waits for it, and raises its errors.

    Parameters
    ----------
    drawer : a process of `optopad.report`
    with_page : whether to make these drawings
    done : plots in the folder that are not drawn again
    builds : number of units in a Monte Carlo over manufacturing tolerances; None for none
    memo : store of its finished units
    """
    from optopad.screen.figures import summary_words
    from optopad.screen.verdict import answer_of
    from optopad.sims.score.build_tolerance import with_builds, with_tolerance
    from optopad.sims.score.field_steps import with_field_steps
    from optopad.sims.score.scoring import score as judge
    from optopad.sims.score.trials import with_trial

    sims = folder / "sims"
    sims.mkdir(exist_ok=True)
    for kind in ("svg", "png"):  # of an earlier score: a bundle has one verdict
        (sims / f"builds.{kind}").unlink(missing_ok=True)
    if with_page:
        drawer.begin("prepare", design)
    begun: list[Callable[[], Any]] = []

    def begin(score: ContinuityScore) -> None:
        plots = [folder / name for name in done]
        begun.append(drawer.begin("draw_early", design, score, sims, plots, seed=seed, with_page=with_page))

    score = judge(design, fine=fine, full=full, seed=seed, tolerance=False, on_judged=begin, on_step=on_step)
    if not begun:  # the design is outside the range of the models
        begin(score)
    if builds is None:
        found = with_tolerance(design, score, seed=seed, on_step=on_step)
    else:
        found = with_builds(design, score, builds=builds, seed=seed, memo=memo, on_step=on_step)
    found = with_field_steps(design, found, seed=seed, on_step=on_step)
    found = with_trial(design, found, seed=seed, on_step=on_step)
    late = drawer.begin("draw_tolerance", found) if with_page else None
    _write_plots(design, found, sims)
    write_text_atomically(sims / "score.json", json.dumps(found.to_json(), indent=2) + "\n")
    write_text_atomically(folder / ANSWER, answer_of(design, found, summary_words(design, found)).to_text())

    def drawn() -> None:
        begun[0]()
        if late is not None:
            late()

    return found, drawn


def _write_plots(design: SensorDesign, score: ContinuityScore, sims: Path) -> None:
    """Write the plots of the bounds and of the manufactured units, as far as the score has them."""
    if score.bounds is not None:
        from optopad.sims.plots.files import write_bound_plots

        write_bound_plots(design, score.bounds, sims)
    if score.builds is not None and score.tolerance is not None:
        from optopad.sims.plots.builds import plot_builds
        from optopad.sims.plots.files import write_plot
        from optopad.sims.plots.style import plain_style

        with plain_style():
            write_plot(plot_builds(score.builds, score.tolerance), sims / "builds")


def simulated_gain(score: ContinuityScore) -> SimulatedGain | None:
    """The gains and the untouched light of a score; None if the models do not cover the design."""
    from optopad.fabrication.gain import SimulatedGain

    if score.readout is None or score.untouched_flux is None:
        return None
    return SimulatedGain(
        counts_per_flux=score.readout.of_each(score.untouched_flux.shape[1]),
        untouched_flux=tuple(tuple(row) for row in score.untouched_flux.tolist()),
    )


def write_fabrication(
    design: SensorDesign,
    folder: Path,
    gain: SimulatedGain | None,
    mold_mm3: float,
    prices: Mapping[PriceKey, Price] | None = None,
) -> tuple[BomRow, ...]:
    """Write sheets, circuit board and firmware; return the rows of the bill of materials."""
    from optopad.design.circuit.circuit import Circuit
    from optopad.design.pad import Pad
    from optopad.fabrication.board import board_gaps, board_of, write_board, write_gaps
    from optopad.fabrication.sheets.all_sheets import write_sheets
    from optopad.fabrication.sheets.bom import bom_rows
    from optopad.fabrication.sheets.prices import priced
    from optopad.fabrication.sketch import firmware_gaps, firmware_settings, write_sketch

    rows = priced(bom_rows(design, gain, mold_mm3), prices or {})
    (folder / "fabrication").mkdir(exist_ok=True)
    write_sheets(design, folder / "fabrication", gain, rows)
    board = folder / "fabrication" / "board"
    if gaps := board_gaps(Circuit.of(design), gain):  # a chip whose pins are not known
        write_gaps(gaps, board)
    else:
        write_board(board_of(design, gain), board)
    if not firmware_gaps(Circuit.of(design)):  # a board that cannot be programmed has its warning
        write_sketch(firmware_settings(Pad.of(design)), folder / "fabrication" / "firmware")
    return rows


def write_pages(
    design: SensorDesign,
    folder: Path,
    score: ContinuityScore,
    seed: int,
    drawer: OtherProcess,
) -> None:
    """Write what follows from a verdict and a mold: sheets, firmware, driver configuration, report.

    Parameters
    ----------
    drawer : the process of `optopad.report` that drew the score (`scored`)
    """
    checks = checks_of(folder / "cad")
    write_fabrication(design, folder, simulated_gain(score), mold_mm3(checks))
    drawer.begin("write", design, folder, score, checks, seed=seed)()

"""The computations of `optopad run` and its parts: each function writes one part of the bundle.

A part that the bundle already has from the same inputs is not made again (`optopad.fabrication.bundle.Part`): the mold,
and everything else, which follows from the verdict. A mold may also come from another bundle, since electronics, gain
and surfaces do not change it. Light that was traced before is read from disk in any case.

Mold and physics run in parallel. The mold is made in a new process, because the CAD kernel does not survive a fork. The
physics runs in this process.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optopad.design.errors import InputError, OutputError
from optopad.design.io import save_design, write_text_atomically
from optopad.design.parts.assumptions import Bed
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import (
    Part,
    altered_files,
    bundle,
    bundle_name,
    copy_part,
    is_current,
    program_digest,
)
from optopad.work import FinishedWork, started

if TYPE_CHECKING:
    from optopad.fabrication.gain import SimulatedGain
    from optopad.fabrication.sheets.bom import BomRow
    from optopad.fabrication.sheets.prices import Price, PriceKey
    from optopad.report.sections.early import EarlyDrawings
    from optopad.screen.bundle import Bundle
    from optopad.sims.score.result import ContinuityScore

REFUSED = 2
"""Exit code of the mold's process if it refused the work with a message for the user."""

ANSWER = "answer.json"
"""File in a bundle's ``sims`` with the texts of the screen (`optopad.screen.answer`)."""

Press = tuple[float, float, float]


def run(
    design: SensorDesign,
    out: Path,
    *,
    fine: bool,
    seed: int,
    force: bool = False,
    on_start: Callable[[], None] = lambda: None,
    on_step: OnStep,
) -> Bundle:
    """Make the whole bundle of a design: mold, verdict, sheets, firmware, driver configuration, report.

    Parameters
    ----------
    force : whether to make parts again that the bundle has from the same inputs
    on_start : called before the verdict is computed

    Raises
    ------
    DesignError : the design breaks a rule; nothing is written.
    OutputError : the folder cannot be written; an earlier bundle is intact.
    """
    from optopad.screen.bundle import Bundle

    require_valid(design)
    final, mold, answer = out / bundle_name(design), mold_part(design), answer_part(design, seed, fine=fine)
    kept = [] if force else [part for part in (mold, answer) if is_current(final, part)]
    altered = _altered(final)
    found: ContinuityScore | None = None
    if len(kept) < 2 or "design.toml" in altered:
        with bundle(design, out, seed=seed, parts=(mold, answer)) as folder:
            has_mold = mold in kept or (not force and _copied_mold(design, mold, folder, out))
            with nullcontext() if has_mold else _mold_beside(design, folder) as process:
                if answer not in kept:
                    on_start()
                    found, early = _scored(
                        design, folder, fine=fine, seed=seed, on_step=on_step, with_page=True
                    )
                if process is not None:
                    on_step("mold beside", 0.0)
                    _finish(process)
                    on_step("mold beside", 1.0)
            if found is not None:
                on_step("files", 0.0)
                checks = _checks(folder / "cad")
                _write_fabrication(design, folder, _gain_of(found), _mold_mm3(checks))
                _write_report(design, folder, found, checks, seed, early)
                on_step("files", 1.0)
    return Bundle(
        design=design,
        folder=final,
        checks=_checks(final / "cad"),
        score_of=lambda: found or _again(design, fine=fine, seed=seed),
        is_current=len(kept) == 2,
        mended=tuple(name for name in altered if (final / name).is_file()),
    )


def _again(design: SensorDesign, *, fine: bool, seed: int) -> ContinuityScore:
    from optopad.sims.score.scoring import score

    return score(design, fine=fine, seed=seed)


def mold_part(design: SensorDesign, **settings: Any) -> Part:
    """The mold and its tools as a part of a bundle; `settings` are those of `write_parts`."""
    return Part({"mold": design.mold_digest, "program": program_digest(), **settings}, ("cad/",))


def answer_part(design: SensorDesign, seed: int, **settings: Any) -> Part:
    """The verdict and what follows from it as a part of a bundle; `settings` are those of a score."""
    inputs = {"design": design.digest, "seed": seed, "program": program_digest(), **settings}
    return Part(inputs, ("sims/", "fabrication/", "report.html"))


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
    checks = _checks(folder / "cad") | {"digest": design.digest}
    write_text_atomically(folder / "cad" / "checks.json", json.dumps(checks, indent=2) + "\n")
    return True


def write_parts(
    design: SensorDesign,
    out: Path,
    *,
    seed: int,
    on_step: OnStep,
    bed_mm: Bed | None = None,
    slice_parts: bool = False,
) -> tuple[dict[str, Any], Path]:
    """Write mold and tools into the bundle; returns the mold's checks and the bundle's folder.

    Parameters
    ----------
    bed_mm : build volume of the printer, for the checks [mm]; None for the default one
    slice_parts : whether to run PrusaSlicer for time, filament and warnings
    """
    from optopad.cad.export import export_parts

    require_valid(design)
    on_step("mold", 0.0)
    settings = (
        {"bed_mm": bed_mm, "slice_parts": True}
        if slice_parts
        else {}
        if bed_mm is None
        else {"bed_mm": bed_mm}
    )
    with bundle(design, out, seed=seed, parts=(mold_part(design, **settings),)) as folder:
        (folder / "cad").mkdir(exist_ok=True)
        export_parts(design, folder / "cad", bed_mm=bed_mm, slice_parts=slice_parts)
        checks = _checks(folder / "cad")
        on_step("mold", 1.0)
    return checks, out / bundle_name(design)


def write_score(
    design: SensorDesign,
    out: Path,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
    full: bool = False,
    builds: int | None = None,
) -> tuple[ContinuityScore, Path]:
    """Write verdict, map and the map's signals into the bundle; returns the score and the bundle's folder.

    Parameters
    ----------
    full : whether to compute a finer map
    fine : whether to compute the finer map with finer settings of the light model
    builds : number of units in a Monte Carlo study over manufacturing tolerances; None for no study
    """
    require_valid(design)
    settings = (
        {"fine": fine} | ({"full": full} if full else {}) | ({"builds": builds} if builds is not None else {})
    )
    parts = (answer_part(design, seed, **settings),)
    with _study(design, out, builds, seed) as study, bundle(design, out, seed=seed, parts=parts) as folder:
        has_page = (folder / "report.html").exists()  # a bundle has one verdict: page and gain are updated
        score, early = _scored(
            design,
            folder,
            fine=fine,
            full=full,
            seed=seed,
            on_step=on_step,
            with_page=has_page,
            study=study,
        )
        if has_page:
            checks = _checks(folder / "cad")
            _write_fabrication(design, folder, _gain_of(score), _mold_mm3(checks))
            _write_report(design, folder, score, checks, seed, early)
    return score, out / bundle_name(design)


def write_signals(
    design: SensorDesign,
    presses: list[Press],
    out: Path,
    *,
    seed: int,
    on_step: OnStep,
) -> tuple[dict[str, Any], Path]:
    """Write the signals of presses into the bundle; returns a summary and the bundle's folder."""
    from optopad.jobs.signals import simulated

    require_valid(design)
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        summary = simulated(design, presses, folder / "sims", seed=seed, on_step=on_step)
    return summary, out / bundle_name(design)


def write_driver_config(
    design: SensorDesign, out: Path, *, seed: int, prices: Mapping[PriceKey, Price] | None = None
) -> tuple[Path, tuple[BomRow, ...]]:
    """Write driver configuration, wiring table and bill of materials into the bundle.

    Parameters
    ----------
    prices : the user's own prices by item, which take precedence; None for none

    Returns
    -------
    The bundle's folder, and the rows of the bill of materials.
    """
    require_valid(design)
    with bundle(design, out, seed=seed) as folder:
        gain = _known_gain(folder)
        try:
            mold_mm3 = _mold_mm3(_checks(folder / "cad"))
        except (OSError, ValueError, KeyError, TypeError, RecursionError):  # not made yet, or damaged
            from optopad.cad.mold import build_mold

            mold_mm3 = float(build_mold(design).val().Volume())  # type: ignore[union-attr]
        rows = _write_fabrication(design, folder, gain, mold_mm3, prices)
    return out / bundle_name(design), rows


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


def _checks(folder: Path) -> dict[str, Any]:
    checks: dict[str, Any] = json.loads((folder / "checks.json").read_text(encoding="utf-8"))
    return checks


def _mold_mm3(checks: dict[str, Any]) -> float:
    return float(checks["volumes_mm3"]["mold"]["solid"])


@dataclass(frozen=True, kw_only=True)
class _Study:
    """A Monte Carlo over tolerances: requested number of simulated units, and store of finished ones."""

    builds: int
    memo: FinishedWork


@contextmanager
def _study(design: SensorDesign, out: Path, builds: int | None, seed: int) -> Iterator[_Study | None]:
    """Yield the Monte Carlo over tolerances with its store, removed afterwards; None if `builds` is None."""
    if builds is None:
        yield None
        return
    memo = FinishedWork(out, f"{bundle_name(design)}.builds", [design.digest, seed])
    yield _Study(builds=builds, memo=memo)
    memo.forget()


def _scored(
    design: SensorDesign,
    folder: Path,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
    with_page: bool,
    full: bool = False,
    study: _Study | None = None,
) -> tuple[ContinuityScore, EarlyDrawings | None]:
    """Compute and write the score; draw the plots of the report page if `with_page`.

    Files that do not depend on the tolerances are written while the effect of tolerances is computed.
    """
    from optopad.screen.figures import summary_words
    from optopad.screen.verdict import answer_of
    from optopad.sims.score.build_tolerance import with_tolerance
    from optopad.sims.score.field_steps import with_field_steps
    from optopad.sims.score.scoring import score as judge
    from optopad.sims.score.trials import with_trial
    from optopad.work import beside

    sims = folder / "sims"
    sims.mkdir(exist_ok=True)
    for kind in ("svg", "png"):  # of an earlier score: a bundle has one verdict
        (sims / f"builds.{kind}").unlink(missing_ok=True)
    score = judge(design, fine=fine, full=full, seed=seed, tolerance=False, on_step=on_step)
    with beside(lambda: _without_tolerance(design, score, sims, seed, with_page=with_page)) as drawn:
        if study is None:
            found = with_tolerance(design, score, seed=seed, on_step=on_step)
        else:
            found = _with_builds(design, score, study, seed=seed, on_step=on_step)
        found = with_field_steps(design, found, seed=seed, on_step=on_step)
        found = with_trial(design, found, seed=seed, on_step=on_step)
        early = drawn()
    _write_builds(found, sims)
    write_text_atomically(sims / "score.json", json.dumps(found.to_json(), indent=2) + "\n")
    write_text_atomically(sims / ANSWER, answer_of(design, found, summary_words(design, found)).to_text())
    return found, early


def _without_tolerance(
    design: SensorDesign, score: ContinuityScore, sims: Path, seed: int, *, with_page: bool
) -> EarlyDrawings | None:
    from optopad.design.shape.cavity import cavity_of
    from optopad.report.sections.early import early_drawings
    from optopad.sims.plots.files import write_bound_plots
    from optopad.sims.readings.readout import save_dataset, signals_dataset
    from optopad.sims.score.maps_file import maps_dataset

    if score.pad_signals is not None and score.readout is not None:
        gain = score.readout.counts_per_flux
        save_dataset(
            signals_dataset(score.pad_signals, cavity_of(design), counts_per_flux=gain), sims / "signals.nc"
        )
        save_dataset(maps_dataset(design, score), sims / "maps.nc")
    if score.bounds is not None:
        write_bound_plots(design, score.bounds, sims)
    return early_drawings(design, score, seed=seed) if with_page else None


def _with_builds(
    design: SensorDesign, score: ContinuityScore, study: _Study, *, seed: int, on_step: OnStep
) -> ContinuityScore:
    from optopad.sims.score.build_tolerance import with_builds

    return with_builds(design, score, builds=study.builds, seed=seed, memo=study.memo, on_step=on_step)


def _write_builds(score: ContinuityScore, sims: Path) -> None:
    if score.builds is None or score.tolerance is None:
        return
    from optopad.sims.plots.builds import plot_builds
    from optopad.sims.plots.files import write_plot
    from optopad.sims.plots.style import plain_style

    with plain_style():
        write_plot(plot_builds(score.builds, score.tolerance), sims / "builds")


def _gain_of(score: ContinuityScore) -> SimulatedGain | None:
    from optopad.fabrication.gain import SimulatedGain

    if score.readout is None or score.untouched_flux is None:
        return None
    return SimulatedGain(
        counts_per_flux=score.readout.of_each(score.untouched_flux.shape[1]),
        untouched_flux=tuple(tuple(row) for row in score.untouched_flux.tolist()),
    )


def _known_gain(folder: Path) -> SimulatedGain | None:
    from optopad.fabrication.gain import gain_of

    score = folder / "sims" / "score.json"
    if not score.is_file():
        return None
    try:
        return gain_of(json.loads(score.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{score}: damaged, or of an earlier version; run `optopad score` again") from None


def _write_fabrication(
    design: SensorDesign,
    folder: Path,
    gain: SimulatedGain | None,
    mold_mm3: float,
    prices: Mapping[PriceKey, Price] | None = None,
) -> tuple[BomRow, ...]:
    """Write sheets and firmware; return the rows of the bill of materials."""
    from optopad.design.circuit.circuit import Circuit
    from optopad.design.pad import Pad
    from optopad.fabrication.sheets.all_sheets import write_sheets
    from optopad.fabrication.sheets.bom import bom_rows
    from optopad.fabrication.sheets.prices import priced
    from optopad.fabrication.sketch import firmware_gaps, firmware_settings, write_sketch

    rows = priced(bom_rows(design, gain, mold_mm3), prices or {})
    (folder / "fabrication").mkdir(exist_ok=True)
    write_sheets(design, folder / "fabrication", gain, rows)
    if not firmware_gaps(Circuit.of(design)):  # a board that cannot be programmed has its warning
        write_sketch(firmware_settings(Pad.of(design)), folder / "fabrication" / "firmware")
    return rows


def _write_report(
    design: SensorDesign,
    folder: Path,
    score: ContinuityScore,
    checks: dict[str, Any],
    seed: int,
    early: EarlyDrawings | None,
) -> None:
    from optopad.report.page import write_report

    write_report(design, folder, score, checks, seed=seed, early=early)

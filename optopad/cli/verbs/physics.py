"""Verbs of the physics: simulate, score."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from design.errors import InputError
from design.spec import SensorDesign
from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import foretell_score, progress
from optopad.work.designs import read_design

DEFAULT_ORACLE_RAYS = 1_000_000


def score(
    design: options.Design,
    set_: options.Set = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="11 places a side and 0.1 mm steps for the map, at the usual light."),
    ] = False,
    fine: options.Fine = False,
    tolerance: Annotated[
        bool,
        typer.Option("--tolerance", help="Also draw builds with everything off that may be, and judge each."),
    ] = False,
    builds: Annotated[
        int | None, typer.Option("--builds", help="How many builds --tolerance draws (200 if left out).")
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    details: options.Details = False,
    as_json: options.Json = False,
) -> None:
    """Verdict: modes, deadbands, continuity, strength, map of the pad; written into the bundle."""
    drawn = _drawn_builds(tolerance, builds)
    from optopad.jobs.pipeline import write_score
    from optopad.screen.verdict import as_typed, learner_line, score_lines, verdict_screen

    read = read_design(design, set_)
    foretell_score(read, fine=fine, full=full, quiet=as_json)
    with progress(quiet=as_json) as step:
        result, folder = write_score(read, out, fine=fine, full=full, seed=seed, on_step=step, builds=drawn)
    typed = as_typed(design, set_)
    tell(
        as_json,
        result.to_json,
        lambda: (
            [*score_lines(result), f"files     {folder}"]
            if details
            else verdict_screen(
                read,
                result,
                [f"files       {folder}"],
                command=typed,
                learner=learner_line(read, folder, typed),
            )
        ),
    )


def _drawn_builds(tolerance: bool, builds: int | None) -> int | None:
    """How many builds to draw; None without ``--tolerance``."""
    if not tolerance:
        if builds is not None:
            raise InputError("--builds: needs --tolerance, which draws them; add it")
        return None
    from sims.continuity.build_tolerance import DEFAULT_BUILDS
    from sims.verdict.build_study import FEWEST_BUILDS, MOST_BUILDS

    drawn = DEFAULT_BUILDS if builds is None else builds
    if not FEWEST_BUILDS <= drawn <= MOST_BUILDS:
        raise InputError(f"--builds: {drawn} is refused: give {FEWEST_BUILDS} to {MOST_BUILDS}")
    return drawn


def simulate(
    design: options.Design,
    press: Annotated[
        list[str] | None,
        typer.Option(
            "--press", metavar="X,Y,DEPTH", help="A press [mm]; repeatable. Default: centre, all depths."
        ),
    ] = None,
    oracle: Annotated[
        bool, typer.Option("--oracle", help="Also trace with the plain ray tracer and compare.")
    ] = False,
    rays: Annotated[
        int | None,
        typer.Option(
            min=1000, help="Rays per emitter and state of --oracle's ray tracer (1000000 if left out)."
        ),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            "--protocol",
            metavar="NAME|FILE",
            help="Press by a protocol and make its data set: piacenza2017, piacenza2017-quick, or a file.",
        ),
    ] = None,
    fit: Annotated[
        bool, typer.Option("--fit", help="With --protocol: leave out depths beyond the design's range.")
    ] = False,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Light of chosen presses, path classes apart, or the data set of a press protocol; netCDF into the bundle."""
    read = read_design(design, set_)
    if protocol is not None:
        _refuse_beside_protocol(press=press, oracle=oracle, rays=rays)
        _simulate_protocol(read, protocol, fit=fit, out=out, seed=seed, as_json=as_json)
        return
    if fit:
        raise InputError("--fit: needs --protocol, whose depths it fits; drop it")
    oracle_rays = _oracle_rays(oracle, rays)
    from optopad.jobs.pipeline import write_signals

    presses = [options.parsed_press(text) for text in press or []]
    with progress(quiet=as_json) as step:
        summary, folder = write_signals(read, presses, out, oracle_rays=oracle_rays, seed=seed, on_step=step)
    tell(as_json, lambda: summary, lambda: [*_signal_lines(summary), f"files     {folder}"])


def _oracle_rays(oracle: bool, rays: int | None) -> int | None:
    """Rays of the ray tracer; None without ``--oracle``."""
    if not oracle:
        if rays is not None:
            raise InputError(f"--rays: {rays} needs --oracle, which traces them; add it, or drop --rays")
        return None
    return DEFAULT_ORACLE_RAYS if rays is None else rays


def _refuse_beside_protocol(**given: Any) -> None:
    for name, value in given.items():
        if value:
            raise InputError(f"--{name}: does not go with --protocol, which has presses of its own; drop one")


def _simulate_protocol(
    design: SensorDesign, where: str, *, fit: bool, out: Path, seed: int, as_json: bool
) -> None:
    from design.protocols.press import load_protocol_file
    from optopad.jobs.protocol_data import data_lines, write_protocol_data

    protocol = load_protocol_file(where)
    with progress(quiet=as_json) as step:
        summary = write_protocol_data(
            design, protocol.fitted_to(design) if fit else protocol, out, seed=seed, on_step=step
        )
    tell(as_json, lambda: summary, lambda: data_lines(summary))


def _signal_lines(summary: dict[str, Any]) -> Iterator[str]:
    for state in summary["states"]:
        x_mm, y_mm, depth_mm = state["press_mm"]
        shares = "  ".join(f"{name} {value:.3e}" for name, value in state["mean_flux_by_class"].items())
        yield (
            f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm  mean flux {state['mean_flux']:.4e}  {shares}"
        )
    if summary["oracle"] is not None:
        found = summary["oracle"]
        yield (
            f"ray tracer: {found['rays']} rays an emitter; chi-square {found['chi_square']:.1f} over "
            f"{found['compared']} pairs and states; largest difference {found['largest_z']:.1f} standard errors"
        )

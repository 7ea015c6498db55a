"""Verbs of the physics: simulate, score."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from optopad.cli.common import (
    DEFAULT_OUT,
    DesignArgument,
    FineOption,
    JsonOption,
    OutOption,
    SeedOption,
    SetOption,
    parsed_press,
    print_json,
    read_design,
    say,
)
from optopad.cli.progress import progress


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.command()(simulate)
    app.command()(score)


def score(
    design: DesignArgument,
    set_: SetOption = None,
    fine: FineOption = False,
    tolerance: Annotated[
        bool,
        typer.Option("--tolerance", help="Also draw builds with everything off that may be, and judge each."),
    ] = False,
    builds: Annotated[
        int | None, typer.Option("--builds", help="How many builds --tolerance draws (200 if left out).")
    ] = None,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Verdict: modes, deadbands, continuity, strength, map of the pad; written into the bundle."""
    drawn = _drawn_builds(tolerance, builds)
    from optopad.pipeline import write_score
    from optopad.summary import score_lines

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        result, folder = write_score(read, out, fine=fine, seed=seed, on_step=step, builds=drawn)
    if as_json:
        print_json(result.to_json())
    else:
        say("\n".join(score_lines(result)))
        say(f"files     {folder}")


def _drawn_builds(tolerance: bool, builds: int | None) -> int | None:
    """How many builds to draw; None without ``--tolerance``."""
    from design.errors import InputError

    if not tolerance:
        if builds is not None:
            raise InputError("--builds: needs --tolerance, which draws them; add it")
        return None
    from sims.build_tolerance import DEFAULT_BUILDS
    from sims.verdict.build_study import FEWEST_BUILDS, MOST_BUILDS

    drawn = DEFAULT_BUILDS if builds is None else builds
    if not FEWEST_BUILDS <= drawn <= MOST_BUILDS:
        raise InputError(f"--builds: {drawn} is refused: give {FEWEST_BUILDS} to {MOST_BUILDS}")
    return drawn


def simulate(
    design: DesignArgument,
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
        int, typer.Option(min=1000, help="Rays per emitter and state of the ray tracer.")
    ] = 1_000_000,
    set_: SetOption = None,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Light from every emitter to every receiver, path classes apart; netCDF into the bundle."""
    from optopad.pipeline import write_signals

    read = read_design(design, set_)
    presses = [parsed_press(text) for text in press or []]
    with progress(quiet=as_json) as step:
        summary, folder = write_signals(
            read, presses, out, oracle_rays=rays if oracle else None, seed=seed, on_step=step
        )
    if as_json:
        print_json(summary)
    else:
        _say_signals(summary)
        say(f"files     {folder}")


def _say_signals(summary: dict[str, Any]) -> None:
    for state in summary["states"]:
        x_mm, y_mm, depth_mm = state["press_mm"]
        shares = "  ".join(f"{name} {value:.3e}" for name, value in state["mean_flux_by_class"].items())
        say(
            f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm  mean flux {state['mean_flux']:.4e}  {shares}"
        )
    if summary["oracle"] is not None:
        found = summary["oracle"]
        say(
            f"ray tracer: {found['rays']} rays an emitter; chi-square {found['chi_square']:.1f} over "
            f"{found['compared']} pairs and states; largest difference {found['largest_z']:.1f} standard errors"
        )

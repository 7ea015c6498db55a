"""Verbs of the physics: simulate, score, sweep."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    parsed_value,
    print_json,
    read_design,
    say,
)
from optopad.cli.progress import progress

if TYPE_CHECKING:
    from design.spec import SensorDesign

MAX_SWEEP_VALUES = 200


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.command()(simulate)
    app.command()(score)
    app.command()(sweep)


def score(
    design: DesignArgument,
    set_: SetOption = None,
    fine: FineOption = False,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Verdict: modes, deadbands, continuity, strength, map of the pad; written into the bundle."""
    from optopad.pipeline import write_score
    from optopad.summary import score_lines

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        result, folder = write_score(read, out, fine=fine, seed=seed, on_step=step)
    if as_json:
        print_json(result.to_json())
    else:
        say("\n".join(score_lines(result)))
        say(f"files     {folder}")


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


def sweep(
    design: DesignArgument,
    field: Annotated[str, typer.Argument(metavar="FIELD=A:B:STEP", help="Field to vary; or FIELD=v1,v2,...")],
    set_: SetOption = None,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Score a design at several values of one field."""
    path, values = parsed_sweep(field)
    read = read_design(design, set_)
    builds = [_valid_build(read, path, value) for value in values]
    from sims.continuity import score as judge

    rows = []
    with progress(quiet=as_json) as step:
        for done, (value, build) in enumerate(zip(values, builds, strict=True)):
            result = judge(build, seed=seed, verdict_only=True)
            rows.append({"value": value} | result.to_json())
            step(f"sweep of {path}", (done + 1) / len(values))
    folder = _write_sweep(read, out, path, rows, seed)
    if as_json:
        print_json({"field": path, "rows": rows})
    else:
        _say_sweep(path, rows)
        say(f"files     {folder}")


def parsed_sweep(text: str) -> tuple[str, list[Any]]:
    """Field and values of ``FIELD=A:B:STEP`` (both ends included) or ``FIELD=v1,v2,...``.

    Raises
    ------
    InputError : not of that form, or an empty or endless range.
    """
    from design.errors import InputError

    path, equals, span = text.partition("=")
    if not equals or not path or not span:
        raise InputError(
            f"sweep: {text!r} is refused: write FIELD=A:B:STEP, as cavity.clear_thickness_mm=6:12:0.5"
        )
    if ":" not in span:
        return path, [parsed_value(value) for value in span.split(",")]
    try:
        first, last, step = (float(number) for number in span.split(":"))
    except ValueError:
        raise InputError(f"sweep: {span!r} is refused: write A:B:STEP, three numbers") from None
    steps = (last - first) / step + 1e-9 if step > 0 else math.nan
    if not 0 <= steps < MAX_SWEEP_VALUES:  # false for a number that is not finite, too
        raise InputError(
            f"sweep: {span!r} is refused: give 1 to {MAX_SWEEP_VALUES} values, A up to B, STEP above 0"
        )
    return path, [round(first + step * number, 9) for number in range(math.floor(steps) + 1)]


def _valid_build(design: SensorDesign, path: str, value: Any) -> SensorDesign:
    """One design of a sweep; refused before anything is computed, so that no finished value is lost."""
    from design.errors import DesignError
    from design.rules import require_valid

    build = design.with_(**{path: value})
    try:
        require_valid(build)
    except DesignError as err:
        raise DesignError(f"sweep: {path} = {value}: {err}") from None
    return build


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


def _say_sweep(path: str, rows: list[dict[str, Any]]) -> None:
    say(f"{path:<32} verdict       deadband mm  mode gap mm  continuity  evenness  untouched flux")
    for row in rows:
        if row["verdict"] == "OUT_OF_MODEL_SCOPE":
            say(f"{row['value']!s:<32} {row['verdict']}: {row['reason']}")
            continue
        gap = "open" if row["mode_gap_mm"] is None else f"{row['mode_gap_mm']:+.2f}"
        say(
            f"{row['value']!s:<32} {row['verdict']:<12}  {row['deadband_mm']['total']:>11.2f}  {gap:>11}  "
            f"{row['continuity']:>10.2f}  {row['evenness']:>8.2f}  {row['strength']['untouched_flux']:>14.3e}"
        )


def _write_sweep(design: SensorDesign, out: Path, path: str, rows: list[dict[str, Any]], seed: int) -> Path:
    import json

    from design.io import write_text_atomically
    from fabrication.bundle import bundle, bundle_name

    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        text = json.dumps({"field": path, "rows": rows}, indent=2) + "\n"
        write_text_atomically(folder / "sims" / f"sweep-{path}.json", text)
    return out / bundle_name(design)

"""The verb sweep: one field at several values."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import parsed_value, read_design

MAX_SWEEP_VALUES = 200


def sweep(
    design: options.Design,
    field: Annotated[str, typer.Argument(metavar="FIELD=A:B:STEP", help="Field to vary; or FIELD=v1,v2,...")],
    set_: options.Set = None,
    fine: options.Fine = False,
    build: Annotated[
        bool,
        typer.Option(
            "--build", help="Make the whole bundle of every value, its mold engraved with the value."
        ),
    ] = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Score a design at several values of one field: table and figure. Interrupted, it goes on where it stopped."""
    path, values = parsed_sweep(field)
    read = read_design(design, set_)
    from optopad.jobs.sweep import run_sweep

    with progress(quiet=as_json) as step:
        made = run_sweep(read, path, values, out, fine=fine, seed=seed, build=build, on_step=step)
    bundles = [f"bundle    {folder}" for folder in made.bundles]
    files = f"files     {made.folder / 'sims'} (sweep-{path}: csv, json, svg, png)"
    tell(as_json, made.to_json, lambda: [*made.lines(), *bundles, files])


def parsed_sweep(text: str) -> tuple[str, list[Any]]:
    """Field and values of ``FIELD=A:B:STEP`` (both ends included) or ``FIELD=v1,v2,...``.

    Whole numbers stay whole, for fields that count something.

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
        return path, _listed(span)
    try:
        first, last, step = (float(number) for number in span.split(":"))
    except ValueError:
        raise InputError(f"sweep: {span!r} is refused: write A:B:STEP, three numbers") from None
    steps = (last - first) / step + 1e-9 if step > 0 else math.nan
    if not 0 <= steps < MAX_SWEEP_VALUES:  # false for a number that is not finite, too
        raise InputError(
            f"sweep: {span!r} is refused: give 1 to {MAX_SWEEP_VALUES} values, A up to B, STEP above 0"
        )
    values = [round(first + step * number, 9) for number in range(math.floor(steps) + 1)]
    is_whole = all(_is_whole(number) for number in span.split(":"))
    return path, [int(value) for value in values] if is_whole else list(values)


def _is_whole(text: str) -> bool:
    try:
        int(text)
    except ValueError:
        return False
    return True


def _listed(span: str) -> list[Any]:
    from design.errors import InputError

    texts = [text.strip() for text in span.split(",")]
    if not all(texts):
        raise InputError(f"sweep: {span!r} is refused: a value between commas is missing")
    if len(texts) > MAX_SWEEP_VALUES:
        raise InputError(f"sweep: {len(texts)} values are refused: give 1 to {MAX_SWEEP_VALUES}")
    return [parsed_value(text) for text in texts]

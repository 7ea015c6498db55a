"""Scores a design at several values of one field, and writes table and picture to the bundle.

If the scores of neighbouring values disagree (`optopad.sims.score.sweep.disputed`), they are computed again, as by
`optopad score --full` or `--fine`, and marked. With `--fine` (the finest light) or `--build` (a bundle for each value),
no score is computed again.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from optopad.cli.verb import typed, verb
from optopad.design.errors import InputError
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep, silent
from optopad.design.shape.cavity import cavity_of, is_facing_rows
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.figures import figures_of
from optopad.screen.sweep import FINE, FULL, Sweep
from optopad.sims.plots.files import write_plot
from optopad.sims.score.sweep import SweepRow, disputed, sweep_row, swept_designs
from optopad.work import OUT, FinishedWork, parsed_value

NAME_LIMIT = 63
"""Largest number of characters in a design's name."""
MOST_VALUES = 200


@verb(field=typed("FIELD=A:B:STEP"), values=None)
def sweep(
    design: SensorDesign,
    field: str,
    values: Sequence[Any] | None = None,
    *,
    fine: bool = False,
    build: bool = False,
    out: str | PathLike[str] = OUT,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> Sweep:
    """Score a design at values of one field: table and figure; the same command continues an interrupted run.

    Parameters
    ----------
    field : Field to vary; or FIELD=v1,v2,...
    values : values of the field, a dotted path; None if they are in `field`, as on the command line
    build : Make the whole bundle of each value; the value is engraved in its mold.

    Raises
    ------
    DesignError, InputError : a field or value is invalid; nothing was computed.
    OutputError : a folder cannot be written; finished values are stored if possible.
    """
    path, values = parsed_sweep(field) if values is None else (field, values)
    folder, step = Path(out), on_step or silent
    variants = swept_designs(design, path, values)
    if build:
        variants = tuple(marked(variant, value) for variant, value in zip(variants, values, strict=True))
    asked = [[variant.digest for variant in variants], path, fine, seed, build]
    kept = FinishedWork(folder, f"{bundle_name(design)}.sweep", asked)
    taken_up, rows = len(kept), []
    for done, (variant, value) in enumerate(zip(variants, values, strict=True)):
        step(f"sweep of {path}", done / len(values))
        rows.append(_row(variant, value, folder, kept, fine=fine, seed=seed, build=build))
    if not (fine or build):
        again = disputed(rows)
        for done, number in enumerate(again):
            step("rows in dispute", done / len(again))
            rows[number] = _refined(variants[number], rows[number], kept, seed)
    step(f"sweep of {path}", 1.0)
    made = Sweep(
        field=path,
        rows=tuple(rows),
        figures=tuple(figures_of(variant, row.score) for variant, row in zip(variants, rows, strict=True)),
        taken_up=taken_up,
        folder=folder / bundle_name(design),
        bundles=tuple(folder / bundle_name(variant) for variant in variants) if build else (),
    )
    _write(design, folder, made, seed)
    kept.forget()
    return made


def parsed_sweep(text: str) -> tuple[str, list[Any]]:
    """Parse field and values from a text ``FIELD=A:B:STEP`` (both ends included) or ``FIELD=v1,v2,...``.

    Whole numbers become int, for fields that count parts.

    Raises
    ------
    InputError : the text has another form, or the range is empty or infinite.
    """
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
    if not 0 <= steps < MOST_VALUES:  # also false for a number that is not finite
        raise InputError(
            f"sweep: {span!r} is refused: give 1 to {MOST_VALUES} values, A up to B, STEP above 0"
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
    texts = [text.strip() for text in span.split(",")]
    if not all(texts):
        raise InputError(f"sweep: {span!r} is refused: a value between commas is missing")
    if len(texts) > MOST_VALUES:
        raise InputError(f"sweep: {len(texts)} values are refused: give 1 to {MOST_VALUES}")
    return [parsed_value(text) for text in texts]


def marked(design: SensorDesign, value: Any) -> SensorDesign:
    """A copy of a design with a value in its name and engraved in its mold, so that several molds can be distinguished.

    Raises
    ------
    DesignError : the value is too long to be engraved legibly.
    """
    text = f"{value:g}" if isinstance(value, float) else str(value)
    slug = re.sub(r"[^A-Za-z0-9._-]+", "-", text)
    return design.with_(**{"name": f"{design.name}-{slug}"[:NAME_LIMIT].rstrip("."), "mold.label": text})


def _row(
    variant: SensorDesign,
    value: Any,
    out: Path,
    kept: FinishedWork,
    *,
    fine: bool,
    seed: int,
    build: bool,
) -> SweepRow:
    earlier = kept.get(variant.digest)
    if earlier is not None and not (build and not (out / bundle_name(variant)).is_dir()):
        return SweepRow.from_json(earlier)
    row = sweep_row(variant, value, _judged(variant, out, fine=fine, seed=seed, build=build))
    kept.put(variant.digest, row.to_json())
    return row


def _refined(variant: SensorDesign, row: SweepRow, kept: FinishedWork, seed: int) -> SweepRow:
    """Compute a value's score again: for a pad with the finer map, for facing rows with finer settings of light."""
    setting = FULL if row.score["judged_by"] == "pad" else FINE
    name = f"{variant.digest}-{setting}"
    earlier = kept.get(name)
    if earlier is not None:
        return SweepRow.from_json(earlier)
    score = _scored(variant, fine=setting == FINE, full=setting == FULL, seed=seed)
    found = sweep_row(variant, row.value, score)
    again = replace(found, refined=setting)
    kept.put(name, again.to_json())
    return again


def _judged(variant: SensorDesign, out: Path, *, fine: bool, seed: int, build: bool) -> Any:
    if build:
        from optopad.verbs.run import run

        return run(variant, out=out, fine=fine, seed=seed).score.found
    return _scored(variant, fine=fine, seed=seed)


def _scored(variant: SensorDesign, **settings: Any) -> Any:
    """The score without effects of tolerances; for facing rows also without bounds, which take ten times as long."""
    from optopad.sims.score.scoring import score

    is_facing = is_facing_rows(cavity_of(variant))
    return score(variant, tolerance=False, verdict_only=is_facing, **settings)


def _write(design: SensorDesign, out: Path, sweep: Sweep, seed: int) -> None:
    from optopad.sims.plots.style import plain_style
    from optopad.sims.plots.sweep import plot_sweep

    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        stem = folder / "sims" / f"sweep-{sweep.field}"
        text = json.dumps(sweep.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(stem.with_name(f"{stem.name}.json"), text)
        write_text_atomically(stem.with_name(f"{stem.name}.csv"), sweep.to_csv())
        with plain_style():
            write_plot(plot_sweep(sweep.field, sweep.rows), stem)

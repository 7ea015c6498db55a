"""Comparison of designs: their differences, their scores, and the better design by each figure.

Each design is scored with two seeds of the light model. The figure from the first seed is reported. Its uncertainty is
its own numerical error, or for figures of the verdict the difference from the second seed's figure if that is larger.
Depths have at least the error of the depth step (0.04 mm at a boundary between modes, `optopad.sims.press`). A winner
is marked only if it is better than every other design by more than the sum of both uncertainties. Effects outside the
models are assumed equal for all designs, and are not part of the uncertainty. Figures of single pairs have no winner,
because a pad is judged by all pairs together.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from optopad.design.errors import InputError
from optopad.design.fields.base import leaves
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.comparison import NAMES, Comparison, Measure
from optopad.screen.figures import Better, FigureCell, PadFigures, figures_of
from optopad.sims.score.sweep import sweep_row

if TYPE_CHECKING:
    from optopad.sims.score.result import ContinuityScore

MOST_DESIGNS = 12
ABSENT = "(absent)"
OF_ONE_KIND = ("margin", "depth")
"""Figures that mean something else for facing rows than for other pads."""


def compare(
    designs: Sequence[SensorDesign],
    labels: Sequence[str],
    out: Path,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
) -> Comparison:
    """Score designs and compare them; table, page and picture are written into the first design's bundle.

    Raises
    ------
    InputError : fewer than two or too many designs are given, or a design is given twice.
    DesignError : a design breaks a rule; nothing was computed.
    """
    _require_comparable(designs, labels)
    rows, figures, again = [], [], []
    for done, (design, label) in enumerate(zip(designs, labels, strict=True)):
        on_step("comparison", done / len(designs))
        row = sweep_row(design, label, _judged(design, fine=fine, seed=seed, verdict_only=False))
        rows.append(row)
        figures.append(figures_of(design, row.score))
        again.append(figures_of(design, _judged(design, fine=fine, seed=seed + 1, verdict_only=True)))
    on_step("comparison", 1.0)
    found = Comparison(
        labels=tuple(labels),
        digests=tuple(design.digest for design in designs),
        rows=tuple(rows),
        figures=tuple(figures),
        changes=changes_of(designs),
        measures=measures_of(figures, again),
        folder=out / bundle_name(designs[0]) / "sims",
        stem=f"compare-{hashlib.sha256(' '.join(d.digest for d in designs).encode()).hexdigest()[:8]}",
    )
    _write(designs[0], out, found, seed)
    return found


def changes_of(designs: Sequence[SensorDesign]) -> dict[str, tuple[object, ...]]:
    """Fields in which the designs differ, as a mapping from dotted path to the value in each design.

    Name and description come last.
    """
    documents = [dict(leaves(design.model_dump(mode="json"))) for design in designs]
    known = dict.fromkeys(path for document in documents for path in document)
    ordered = sorted(known, key=lambda path: path in NAMES)
    changes = {path: tuple(_given(document.get(path)) for document in documents) for path in ordered}
    return {path: values for path, values in changes.items() if any(one != values[0] for one in values)}


def _given(value: object) -> object:
    """The value of a field, or `ABSENT` for None, so that an empty field equals a missing one in a comparison."""
    return ABSENT if value is None else value


def measures_of(figures: Sequence[PadFigures], again: Sequence[PadFigures]) -> tuple[Measure, ...]:
    """Figures of all designs and their uncertainties, from scores with one seed (`figures`) and another (`again`)."""
    mixed = len({one.is_facing_rows for one in figures}) > 1
    found = []
    for cells, others in zip(
        *(zip(*(one.cells for one in made), strict=True) for made in (figures, again)), strict=True
    ):
        first = cells[0]
        if not first.better:
            continue
        values = tuple(cell.value for cell in cells)
        spread = tuple(map(_uncertainty, cells, others))
        is_alike = not (mixed and first.name in OF_ONE_KIND)
        found.append(
            Measure(
                name=first.name,
                unit=first.unit,
                better=first.better,
                values=values,
                texts=tuple(cell.text for cell in cells),
                uncertainty=spread,
                winner=_winner(first.better, values, spread) if is_alike else None,
            )
        )
    return tuple(found)


def _uncertainty(cell: FigureCell, other: FigureCell) -> float:
    """The figure's own error, or its difference from that of another seed if that is larger."""
    if cell.value is None or other.value is None or math.isinf(cell.value) or math.isinf(other.value):
        return cell.error
    return max(cell.error, abs(cell.value - other.value))


def _winner(better: Better, values: tuple[float | None, ...], spread: tuple[float, ...]) -> int | None:
    if not better or any(value is None for value in values):
        return None
    sign = 1.0 if better == "higher" else -1.0
    ranked = sorted(range(len(values)), key=lambda number: -sign * (values[number] or 0.0))
    best = ranked[0]
    for other in ranked[1:]:
        lead = sign * ((values[best] or 0.0) - (values[other] or 0.0))
        if not lead > spread[best] + spread[other]:  # also if both are infinite
            return None
    return best


def _judged(design: SensorDesign, *, fine: bool, seed: int, verdict_only: bool) -> ContinuityScore:
    from optopad.sims.score.scoring import score

    return score(design, fine=fine, seed=seed, verdict_only=verdict_only, tolerance=False)


def _require_comparable(designs: Sequence[SensorDesign], labels: Sequence[str]) -> None:
    if len(designs) < 2:
        raise InputError(
            "compare: one design alone; name a second, or change a copy of it with --with PATH=VALUE"
        )
    if len(designs) > MOST_DESIGNS:
        raise InputError(f"compare: {len(designs)} designs are refused: give 2 to {MOST_DESIGNS}")
    for number, design in enumerate(designs):
        require_valid(design)
        same = next((k for k in range(number) if designs[k].digest == design.digest), None)
        if same is not None:
            raise InputError(
                f"compare: {labels[same]} and {labels[number]} are the same design; change one of them"
            )


def _write(design: SensorDesign, out: Path, found: Comparison, seed: int) -> None:
    from optopad.plot_files import write_plot
    from optopad.report.before_after import compare_html
    from optopad.sims.plots.style import plain_style, svg_text
    from optopad.sims.plots.sweep import plot_sweep

    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        stem = folder / "sims" / found.stem
        text = json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(stem.with_name(f"{stem.name}.json"), text)
        with plain_style():
            figure = plot_sweep("designs", found.rows)
            write_plot(figure, stem)
            page = compare_html(found, svg_text(figure, stem.name))
        write_text_atomically(stem.with_name(f"{stem.name}.html"), page)

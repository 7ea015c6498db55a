"""Comparison of designs: their differences, their scores, and the better design by each figure.

Each design is scored with two seeds of the light model. The figure from the first seed is reported. Its uncertainty is
the difference from the second seed's figure, and at least the error of the depth step (0.04 mm at a boundary between
modes, `sims.press`). A winner is marked only if it is better than every other design by more than the sum of both
uncertainties. Effects outside the models are assumed equal for all designs, and are not part of the uncertainty.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path

from design.errors import InputError
from design.fields.base import leaves
from design.io import write_text_atomically
from design.progress import OnStep
from design.rules.check import require_valid
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from fabrication.bundle import bundle, bundle_name
from optopad.results.comparison import Better, Comparison, Measure
from sims.score.sweep import SweepRow, sweep_row

MOST_DESIGNS = 12
ABSENT = "(absent)"
SIGNAL = "untouched signal"
USABLE = "usable depth"
BOUNDARY_STEP_MM = 0.04
"""Shift of a boundary of a deadband in depth if the depth step is doubled [mm]."""


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
    judged = []
    for done, design in enumerate(designs):
        on_step("comparison", done / len(designs))
        judged.append(tuple(_row(design, label, fine, seed + k) for k, label in ((0, labels[done]), (1, ""))))
    on_step("comparison", 1.0)
    rows, again = zip(*judged, strict=True)
    found = Comparison(
        labels=tuple(labels),
        digests=tuple(design.digest for design in designs),
        rows=tuple(rows),
        changes=changes_of(designs),
        measures=measures_of(designs, rows, again),
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
    own = ("name", "description")
    ordered = sorted(known, key=lambda path: path in own)
    changes = {path: tuple(_given(document.get(path)) for document in documents) for path in ordered}
    return {path: values for path, values in changes.items() if any(one != values[0] for one in values)}


def _given(value: object) -> object:
    """The value of a field, or `ABSENT` for None, so that an empty field equals a missing one in a comparison."""
    return ABSENT if value is None else value


def measures_of(
    designs: Sequence[SensorDesign], rows: Sequence[SweepRow], again: Sequence[SweepRow]
) -> tuple[Measure, ...]:
    """Figures of all designs and their uncertainties, from scores with one seed (`rows`) and another (`again`)."""
    found = []
    for name, (unit, better, floor, figure) in _FIGURES.items():
        values = tuple(figure(row) for row in rows)
        others = [figure(row) for row in again]
        spread = tuple(
            floor if a is None or b is None else max(floor, abs(a - b))
            for a, b in zip(values, others, strict=True)
        )
        own_error = _OWN_ERRORS.get(name)
        if own_error is not None:
            spread = tuple(max(one, own_error(row)) for one, row in zip(spread, rows, strict=True))
        found.append(_measure(name, unit, better, values, spread))
    sizes = tuple(_pad_height_mm(design) for design in designs)
    counts = tuple(float(len(cavity_of(design).parts)) for design in designs)
    exact = (0.0,) * len(designs)
    return (
        *found,
        _measure("parts", "", "lower", counts, exact),
        _measure("pad height", "mm", "lower", sizes, exact),
    )


def _measure(
    name: str, unit: str, better: Better, values: tuple[float | None, ...], spread: tuple[float, ...]
) -> Measure:
    return Measure(
        name=name,
        unit=unit,
        better=better,
        values=values,
        uncertainty=spread,
        winner=_winner(better, values, spread),
    )


def _winner(better: Better, values: tuple[float | None, ...], spread: tuple[float, ...]) -> int | None:
    if not better or any(value is None for value in values):
        return None
    sign = 1.0 if better == "higher" else -1.0
    ranked = sorted(range(len(values)), key=lambda number: -sign * (values[number] or 0.0))
    best = ranked[0]
    for other in ranked[1:]:
        lead = sign * ((values[best] or 0.0) - (values[other] or 0.0))
        if lead <= spread[best] + spread[other]:
            return None
    return best


def _shown(name: str) -> Callable[[SweepRow], float | None]:
    return lambda row: row.shown.get(name)


def _deadband(row: SweepRow) -> float | None:
    total = row.score["deadband_mm"]["total"]
    return None if total is None else float(total)


def _dead_pairs(row: SweepRow) -> float | None:
    pairs = row.score["pairs_with_deadband"]
    return pairs["count"] / pairs["judged"] if pairs["judged"] else None


def _headline(name: str) -> Callable[[SweepRow], float | None]:
    return lambda row: row.score[name]


def _strength(name: str) -> Callable[[SweepRow], float | None]:
    return lambda row: None if row.score["strength"] is None else row.score["strength"][name]


def _onset_n(row: SweepRow) -> float | None:
    load = None if row.forces_n is None else row.forces_n["mode2_onset"]
    return None if load is None else float(load[0])


_FIGURES: dict[str, tuple[str, Better, float, Callable[[SweepRow], float | None]]] = {
    "deadband": ("mm", "lower", 2 * BOUNDARY_STEP_MM, _deadband),
    USABLE: ("mm", "higher", BOUNDARY_STEP_MM, _headline("usable_depth_mm")),
    "pairs with a deadband": ("share", "lower", 0.0, _dead_pairs),
    "mode gap": ("mm", "", BOUNDARY_STEP_MM, _headline("mode_gap_mm")),
    "mode 2 begins": ("N", "", 0.0, _onset_n),
    "continuity": ("", "higher", 0.01, _headline("continuity")),
    "evenness": ("", "higher", 0.01, _headline("evenness")),
    SIGNAL: ("of emitted", "higher", 0.0, _strength("untouched_flux")),
    "swing": ("share", "higher", 0.0, _strength("swing")),
    "resolvable steps": ("", "higher", 1.0, _strength("resolvable_steps")),
}


def _signal_error(row: SweepRow) -> float:
    """Uncertainty of the signal without contact: its standard error, because two seeds may agree by chance."""
    return 0.0 if row.curve is None else row.curve.standard_error[0]


def _usable_error(row: SweepRow) -> float:
    usable_mm, between_mm = row.score["usable_depth_mm"], row.score["usable_range_mm"]
    return 0.0 if between_mm is None else max(abs(float(usable_mm - end)) for end in between_mm)


_OWN_ERRORS: dict[str, Callable[[SweepRow], float]] = {SIGNAL: _signal_error, USABLE: _usable_error}
"""Functions that compute a figure's uncertainty from a single score; the key is the name of the figure."""


def _pad_height_mm(design: SensorDesign) -> float:
    return design.cavity.clear_thickness_mm + design.cavity.black_thickness_mm


def _row(design: SensorDesign, label: str, fine: bool, seed: int) -> SweepRow:
    from sims.score.scoring import score

    return sweep_row(design, label, score(design, fine=fine, seed=seed, verdict_only=True))


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
    from sims.plots.style import plain_style, svg_text
    from sims.plots.sweep import plot_sweep

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

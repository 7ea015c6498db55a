"""One field at several values: judged one after another, kept as they finish, then table and figure in the bundle.

Where neighbours disagree (`sims.continuity.sweep.disputed`), their rows are judged again as `optopad score --full` or
`--fine` judges, and say so. A sweep with `--fine` has the finest light already; with `--build` a row is the score of
its bundle.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from design.io import write_text_atomically
from design.progress import OnStep
from design.spec import SensorDesign
from fabrication.bundle import bundle, bundle_name
from optopad.work.finished import FinishedWork
from optopad.work.plot_files import write_plot
from sims.continuity.sweep import SweepRow, disputed, sweep_row, swept_designs

FULL, FINE = "full", "fine"
"""Settings of `optopad score` by which rows in dispute are judged again."""
NAME_LIMIT = 63
"""Longest name of a design."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A finished sweep.

    Attributes
    ----------
    path : the field
    rows : in the order of the values
    taken_up : how many rows an interrupted run had finished
    folder : the bundle with table and figure
    bundles : with ``--build``, the bundle of every value
    """

    path: str
    rows: tuple[SweepRow, ...]
    taken_up: int
    folder: Path
    bundles: tuple[Path, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        document: dict[str, Any] = {"field": self.path, "rows": [row.to_json() for row in self.rows]}
        if self.bundles:
            document["bundles"] = [str(folder) for folder in self.bundles]
        return document


def run_sweep(
    design: SensorDesign,
    path: str,
    values: Sequence[Any],
    out: Path,
    *,
    fine: bool,
    seed: int,
    build: bool,
    on_step: OnStep,
) -> Sweep:
    """Judge a design at several values of one field.

    Parameters
    ----------
    build : make the whole bundle of every value, its mold engraved with the value

    Raises
    ------
    DesignError, InputError : a field or value that is refused; nothing was computed.
    OutputError : a folder that cannot be written; finished values are kept if they can be.
    """
    variants = swept_designs(design, path, values)
    if build:
        variants = tuple(marked(variant, value) for variant, value in zip(variants, values, strict=True))
    asked = [[variant.digest for variant in variants], path, fine, seed, build]
    kept = FinishedWork(out, f"{bundle_name(design)}.sweep", asked)
    taken_up, rows = len(kept), []
    for done, (variant, value) in enumerate(zip(variants, values, strict=True)):
        on_step(f"sweep of {path}", done / len(values))
        rows.append(_row(variant, value, out, kept, fine=fine, seed=seed, build=build))
    if not (fine or build):
        again = disputed(rows)
        for done, number in enumerate(again):
            on_step("rows in dispute", done / len(again))
            rows[number] = _refined(variants[number], rows[number], kept, seed)
    on_step(f"sweep of {path}", 1.0)
    sweep = Sweep(
        path=path,
        rows=tuple(rows),
        taken_up=taken_up,
        folder=out / bundle_name(design),
        bundles=tuple(out / bundle_name(variant) for variant in variants) if build else (),
    )
    _write(design, out, sweep, seed)
    kept.forget()
    return sweep


def marked(design: SensorDesign, value: Any) -> SensorDesign:
    """A design whose name and mold carry a value, so that the molds of a set can be told apart.

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
    """The row judged again: a pad with the finer map, facing pairs with finer light."""
    setting = FULL if row.score["judged_by"] == "pad" else FINE
    name = f"{variant.digest}-{setting}"
    earlier = kept.get(name)
    if earlier is not None:
        return SweepRow.from_json(earlier)
    found = sweep_row(variant, row.value, _judged_finer(variant, setting, seed))
    again = replace(found, refined=setting)
    kept.put(name, again.to_json())
    return again


def _judged_finer(variant: SensorDesign, setting: str, seed: int) -> Any:
    from sims.continuity.scoring import score

    return score(variant, fine=setting == FINE, full=setting == FULL, seed=seed, verdict_only=True)


def _judged(variant: SensorDesign, out: Path, *, fine: bool, seed: int, build: bool) -> Any:
    def silent(_stage: str, _share: float) -> None:
        return None

    if build:
        from optopad.jobs.pipeline import run

        return run(variant, out, fine=fine, seed=seed, on_step=silent).score
    from sims.continuity.scoring import score

    return score(variant, fine=fine, seed=seed, verdict_only=True)


def _write(design: SensorDesign, out: Path, sweep: Sweep, seed: int) -> None:
    from sims.plots.style import plain_style
    from sims.plots.sweep import plot_sweep

    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        stem = folder / "sims" / f"sweep-{sweep.path}"
        text = json.dumps(sweep.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(stem.with_name(f"{stem.name}.json"), text)
        write_text_atomically(stem.with_name(f"{stem.name}.csv"), sweep_csv(sweep))
        with plain_style():
            write_plot(plot_sweep(sweep.path, sweep.rows), stem)


COLUMNS = (
    "verdict",
    "headline",
    "reason",
    "governing_pair",
    "deadband_mm",
    "deadbands_from_to_mm",
    "usable_depth_mm",
    "usable_from_mm",
    "usable_to_mm",
    "is_open",
    "refined",
    "shown_pair",
    "shown_pair_deadband_mm",
    "possible_deadband_mm",
    "mode1_start_mm",
    "mode1_end_mm",
    "mode2_onset_mm",
    "mode2_end_mm",
    "mode_gap_mm",
    *(
        f"{name}_{end}n"
        for name in ("mode1_start", "mode1_end", "mode2_onset", "mode2_end")
        for end in ("", "low_", "high_")
    ),
    "continuity",
    "evenness",
    "untouched_flux",
    "untouched_flux_error",
    "untouched_counts",
    "swing",
    "resolvable_steps",
)
"""Columns of the table after the value. Verdict, deadband and usable depth (with what the light's own error leaves of
it) are the design's; what follows `shown_pair` is that pair's, loads with the ends of the modulus's band."""


def sweep_csv(sweep: Sweep) -> str:
    """The table as CSV; open or unknown entries are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([sweep.path, *COLUMNS])
    for row in sweep.rows:
        cells = table_row(row)
        writer.writerow([row.value, *("" if cells.get(name) is None else cells[name] for name in COLUMNS)])
    return text.getvalue()


def table_row(row: SweepRow) -> dict[str, Any]:
    """The table's columns of a row by name."""
    score = row.score
    cells: dict[str, Any] = {
        "verdict": score["verdict"],
        "headline": row.headline,
        "reason": score["reason"],
        "refined": row.refined or None,
    }
    if row.curve is None or row.forces_n is None:
        return cells
    pair = row.shown
    least_mm, most_mm = score["usable_range_mm"] or (None, None)
    cells |= {
        "usable_depth_mm": score["usable_depth_mm"],
        "usable_from_mm": least_mm,
        "usable_to_mm": most_mm,
        "is_open": score["is_open"],
        "governing_pair": score["governing_pair"],
        "deadband_mm": score["deadband_mm"]["total"],
        "shown_pair": pair["pair"],
        "shown_pair_deadband_mm": round(sum(end - start for start, end in pair["deadbands_mm"]), 4),
        "possible_deadband_mm": row.possible_deadband_mm,
        "deadbands_from_to_mm": " ".join(f"{a:g}-{b:g}" for a, b in score["deadband_mm"]["intervals"]),
        "mode_gap_mm": pair["mode_gap_mm"],
        "continuity": pair["continuity"],
        "evenness": pair["evenness"],
        "untouched_flux": row.curve.total[0],
        "untouched_flux_error": row.curve.standard_error[0],
        **{name: pair[name] for name in ("untouched_counts", "swing", "resolvable_steps")},
    }
    for mode, names in (("mode1", ("start", "end")), ("mode2", ("onset", "end"))):
        for name, depth in zip(names, pair[f"{mode}_mm"], strict=True):
            cells[f"{mode}_{name}_mm"] = depth
            loads = row.forces_n[f"{mode}_{name}"] or (None, None, None)
            for column, load in zip(("n", "low_n", "high_n"), loads, strict=True):
                cells[f"{mode}_{name}_{column}"] = load
    return cells


def sweep_lines(sweep: Sweep) -> list[str]:
    """The table for people, short."""
    width = max(len(sweep.path), *(len(str(row.value)) for row in sweep.rows))
    words = max(len("verdict"), *(len(row.headline) for row in sweep.rows if row.is_judged), 0)
    lines = [
        f"{sweep.path:<{width}}  {'verdict':<{words}}  deadband mm    usable mm  pair   mode 1 mm     mode 2 mm     "
        "gap mm  mode 2 from, N (band)  contin.  even.  untouched"
    ]
    for row in sweep.rows:
        if not row.is_judged:
            lines.append(f"{row.value!s:<{width}}  {row.score['verdict']}: {row.score['reason']}")
        else:
            lines.append(f"{row.value!s:<{width}}  {row.headline:<{words}}  {_cells(row)}")
    if any(row.is_of_another_pair for row in sweep.rows):
        lines.append(
            "A pair behind a deadband is the one that has it; the other figures are those of the pair shown."
        )
    lines += [
        f"{_listed(sweep, setting)} judged again as optopad score --{setting} judges: neighbours disagreed"
        for setting in (FULL, FINE)
        if any(row.refined == setting for row in sweep.rows)
    ]
    if sweep.taken_up:
        lines.append(f"{sweep.taken_up} of {len(sweep.rows)} values were taken up from an interrupted sweep")
    return lines


def _listed(sweep: Sweep, setting: str) -> str:
    return ", ".join(str(row.value) for row in sweep.rows if row.refined == setting)


def _cells(row: SweepRow) -> str:
    cells = table_row(row)
    onset, end, gap = (cells[name] for name in ("mode2_onset_mm", "mode2_end_mm", "mode_gap_mm"))
    mode2 = "never" if onset is None else f"{onset:.2f} to {'open' if end is None else f'{end:.2f}'}"
    load = (
        "-"
        if onset is None
        else f"{cells['mode2_onset_n']:.2f} ({cells['mode2_onset_low_n']:.2f}..{cells['mode2_onset_high_n']:.2f})"
    )
    usable = "-" if cells["usable_depth_mm"] is None else f"{cells['usable_depth_mm']:.2f}"
    dead = f"{cells['deadband_mm']:.2f}" + (f" {cells['governing_pair']}" if row.is_of_another_pair else "")
    return (
        f"{dead:<13}  {usable:>9}  {cells['shown_pair']:<6} "
        f"{cells['mode1_start_mm']:.2f} to {cells['mode1_end_mm']:.2f}  {mode2:<12} "
        f"{'open' if gap is None else f'{gap:+.2f}':>6}  {load:<21}  {cells['continuity']:>7.2f}  "
        f"{cells['evenness']:>5.2f}  {cells['untouched_flux']:.3e}"
    )

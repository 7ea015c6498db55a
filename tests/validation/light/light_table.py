"""The tables of docs/validation/light.md: what the light engine's settings cost and how far off they are.

    python -m tests.validation.light.light_table            every setting on both families of surfaces, some minutes
    python -m tests.validation.light.light_table --fresh    the same, with nothing taken from an interrupted run

Writes the tables and `light.csv` beside the page. Finished runs stay in `build/validation/` under a hash of the
engine's sources. Everything runs on one thread; times are of the processor, which other work on the machine still
lengthens, so compare them with the rate of closest hits measured in the same run.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from pathlib import Path

from tests.bench.measures.benchmark_states import SURFACES
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.light.light_figures import (
    Claims,
    Errors,
    Run,
    Setting,
    claims_of,
    errors_of,
    kept,
    reference_errors,
    relative_errors,
)
from tests.validation.light.light_reference import BUILD, GROUPS

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "light.md"
DATA = PAGE.with_name("light.csv")
MARKS = "<!-- made by tests/validation/light/light_table.py -->", "<!-- end -->"
SETTINGS: tuple[Setting, ...] = ("draft", "score", "standard", "fine")
JUDGED: Setting = "standard"
LIMITS = Errors(rms=6e-4, median=2e-4, p95=1.5e-3, p99=2.5e-3, worst=8e-3, bias=1e-4)
"""What `JUDGED` must hold on the analytic surfaces, at no more than `CORE_SECONDS_LIMIT` a state."""
CORE_SECONDS_LIMIT = 0.026


@dataclass(frozen=True, kw_only=True)
class Row:
    """One setting on one family of surfaces."""

    surface: str
    setting: Setting
    run: Run
    total: Errors
    by_group: dict[str, Errors]
    claims: Claims


def row_of(surface: str, setting: Setting, run: Run, wanted: list[int] | None = None) -> Row:
    """The figures of one run."""
    return Row(
        surface=surface,
        setting=setting,
        run=run,
        total=errors_of(relative_errors(run, surface, wanted)),
        by_group={group: errors_of(relative_errors(run, surface, wanted, group)) for group in GROUPS},
        claims=claims_of(run, surface, wanted),
    )


def rows() -> Iterator[Row]:
    """Every setting on every family of surfaces."""
    for surface in SURFACES:
        for setting in SETTINGS:
            yield row_of(surface, setting, kept(surface, setting))


def exceeded(row: Row) -> list[str]:
    """Names of the errors above `LIMITS`, with both values."""
    return [
        f"{field.name} {getattr(row.total, field.name):.3g} > {getattr(LIMITS, field.name):g}"
        for field in fields(Errors)
        if abs(getattr(row.total, field.name)) > getattr(LIMITS, field.name)
    ]


def percent(value: float) -> str:
    """Three decimals."""
    return f"{100.0 * value:.3f}"


def error_cells(errors: Errors) -> list[str]:
    """Figures of a set of errors, in percent."""
    return [*(percent(getattr(errors, field.name)) for field in fields(Errors))]


def cost_and_claim_cells(row: Row) -> list[str]:
    """Time of a state, error over claimed standard error, and how many errors are within two claims."""
    return [
        f"{row.run.core_seconds:.4f}",
        f"{row.claims.error_over_claim:.2f}",
        f"{100.0 * row.claims.within_two:.0f}",
    ]


ERROR_HEAD = ["rms", "median", "p95", "p99", "worst", "mean"]
COST_AND_CLAIM_HEAD = ["core-s a state", "rms error / rms claim", "within 2 claims, %"]


def markdown(found: list[Row]) -> str:
    """All tables."""
    total = [
        [row.surface, str(row.setting), *error_cells(row.total), *cost_and_claim_cells(row)] for row in found
    ]
    own = [
        f"{surface} {percent(errors.rms)} rms, {percent(errors.p99)} (99th percentile), {percent(errors.worst)} at most"
        for surface in SURFACES
        for errors in [reference_errors(surface)]
    ]
    judged = next(row for row in found if row.surface == "analytic" and row.setting == JUDGED)
    above = exceeded(judged)
    return "\n\n".join(
        [
            f"Made with numba {version('numba')} and numpy {version('numpy')}, one thread.",
            "### Error of the signal, % of the undeformed signal, and cost",
            markdown_table(["surface", "accuracy", *ERROR_HEAD, *COST_AND_CLAIM_HEAD], total),
            f"`{JUDGED}` on analytic surfaces, above a limit: "
            + ("; ".join(above) if above else "nothing")
            + ".",
            "The reference, half the difference of its two runs, % of the undeformed signal: "
            + "; ".join(own)
            + ".",
        ]
    )


def comma_separated(found: list[Row]) -> str:
    """All figures, six significant digits; errors as fractions."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    names = [field.name for field in fields(Errors)]
    heads = [f"{group}_{name}" for group in ("total", *GROUPS) for name in names]
    claims = [field.name for field in fields(Claims)]
    writer.writerow(
        ["surface", "accuracy", *heads, *claims, "core_seconds", "hits_per_second", "plain_hits_per_second"]
    )
    for row in found:
        errors = [value for one in (row.total, *row.by_group.values()) for value in asdict(one).values()]
        values = [*errors, *asdict(row.claims).values(), row.run.core_seconds, *row.run.hits_per_second]
        writer.writerow([row.surface, row.setting, *(f"{value:.6g}" for value in values)])
    return stream.getvalue()


def main(arguments: list[str]) -> None:
    """Make the tables."""
    if "--fresh" in arguments:
        for file in BUILD.glob("run-*.npz"):
            file.unlink()
    found = []
    for row in rows():
        found.append(row)
        cells = [row.surface, str(row.setting), *error_cells(row.total), *cost_and_claim_cells(row)]
        print(" | ".join(cells), file=sys.stderr, flush=True)
    table = markdown(found)
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")
    DATA.write_text(comma_separated(found), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

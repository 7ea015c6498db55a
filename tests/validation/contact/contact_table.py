"""The table of contact errors in docs/validation/contact.md.

    python -m tests.validation.contact.contact_table  compare the model with the stored solutions of the oracle
    python -m tests.validation.contact.contact_table --live  solve the oracle anew first (resumable, an hour or two)

Both write the table and `contact.csv` beside it. Every press is that of `solved_press` in the published pad with its
clear layer changed, so that the elastic depth is 6, 9 or 16 mm, and of the area of the oracle's round pad of 16 mm
radius; its surface is taken before it is run out beyond half the width. The tip radius is 3 mm.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of, half_width_of
from tests.validation.contact.contact_comparison import PressError, oracle_error, press_error
from tests.validation.contact.contact_reference import BUILD, STORED, WALL, build, depths_of, reference_state
from tests.validation.elements.layer_mesh import Grading

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "contact.md"
DATA = PAGE.with_name("contact.csv")
BEGIN, END = "<!-- made by tests/validation/contact/contact_table.py -->", "<!-- end -->"
TIP_RADIUS_MM = 3.0
ELASTIC_DEPTHS_MM = (6.0, 9.0, 16.0)
LARGEST_LIMIT_UM = 60.0
SLOPE_LIMIT_DEG = 0.5


@dataclass(frozen=True, kw_only=True)
class Row:
    """One press of the table: the model against the oracle, and the oracle against its coarser mesh."""

    elastic_depth_mm: float
    depth_mm: float
    model: PressError
    oracle: PressError


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Largest accepted errors of one press."""

    force: float
    surface_rms_um: float
    surface_largest_um: float = LARGEST_LIMIT_UM
    slope_rms_deg: float = SLOPE_LIMIT_DEG


def limits(depth_mm: float) -> Limits:
    """What is accepted at a depth [mm] of a 3 mm tip."""
    middle = 0.5 - 1e-9 <= depth_mm <= 4.0 + 1e-9
    return Limits(force=0.03 if middle else 0.06, surface_rms_um=10.0 if depth_mm <= 3.0 + 1e-9 else 30.0)


def exceeded(row: Row) -> list[str]:
    """Names of the errors above their limits, with both values."""
    most, error = limits(row.depth_mm), row.model
    measured = {
        "force": (abs(error.force_ratio - 1.0), most.force),
        "surface_rms_um": (error.surface_rms_um, most.surface_rms_um),
        "surface_largest_um": (error.surface_largest_um, most.surface_largest_um),
        "slope_rms_deg": (error.slope_rms_deg, most.slope_rms_deg),
    }
    place = f"{row.elastic_depth_mm:g} mm layer at {row.depth_mm:g} mm"
    return [
        f"{place}: {name} {value:.4g} > {limit:g}"
        for name, (value, limit) in measured.items()
        if value > limit
    ]


def pad(elastic_depth_mm: float, deepest_mm: float) -> SensorDesign:
    """The published pad with another clear layer, as large as the oracle's round one."""
    published = preset("piacenza2017-pad")
    side_mm = 2.0 * half_width_of(TIP_RADIUS_MM * WALL)
    return published.with_(
        **{
            "cavity.clear_thickness_mm": elastic_depth_mm - published.cavity.black_thickness_mm,
            "cavity.length_mm": side_mm,
            "cavity.width_mm": side_mm,
            "operating.max_depth_mm": deepest_mm,
        }
    )


def rows(path: Path = STORED) -> Iterator[Row]:
    """Every press of the table."""
    for elastic_depth_mm in ELASTIC_DEPTHS_MM:
        depths_mm = [TIP_RADIUS_MM * depth for depth in depths_of(elastic_depth_mm / TIP_RADIUS_MM)]
        contact = contact_of(pad(elastic_depth_mm, max(depths_mm)))
        for depth_mm in depths_mm:
            state = reference_state(elastic_depth_mm / TIP_RADIUS_MM, depth_mm / TIP_RADIUS_MM, path)
            yield Row(
                elastic_depth_mm=elastic_depth_mm,
                depth_mm=depth_mm,
                model=press_error(
                    solved_press(contact).round_pad_at(depth_mm),
                    state,
                    contact.draft.modulus.value,
                ),
                oracle=oracle_error(state, TIP_RADIUS_MM),
            )


def _cell(value: float, limit: float, digits: int) -> str:
    """A number with its limit; bold where it is above."""
    text = f"{value:.{digits}f}"
    return f"{text if abs(value) <= limit else f'**{text}**'} ({limit:g})"


def _model_row(row: Row) -> list[str]:
    most, error = limits(row.depth_mm), row.model
    return [
        f"{row.elastic_depth_mm:g}",
        f"{row.depth_mm:g}",
        _cell(100.0 * (error.force_ratio - 1.0), 100.0 * most.force, 2),
        _cell(error.surface_rms_um, most.surface_rms_um, 1),
        _cell(error.surface_largest_um, most.surface_largest_um, 1),
        f"{error.wall_rms_um:.1f}",
        f"{error.wall_largest_um:.1f}",
        _cell(error.slope_rms_deg, most.slope_rms_deg, 2),
        f"{error.contact_radius_mm:.3f}",
        f"{error.oracle_radius_mm:.3f}",
    ]


def _oracle_text(found: list[Row]) -> str:
    """The largest differences of the oracle's coarser mesh, over all presses."""
    errors = [row.oracle for row in found]
    return (
        "The oracle's elements of 0.05 against those of 0.025 tip radii, the largest of all presses: "
        f"force {100.0 * max(abs(one.force_ratio - 1.0) for one in errors):.2f} %,\n"
        f"surface {max(one.surface_rms_um for one in errors):.1f} µm rms and "
        f"{max(one.surface_largest_um for one in errors):.1f} µm at most, "
        f"slope {max(one.slope_rms_deg for one in errors):.2f}°, "
        f"contact radius {max(abs(one.contact_radius_mm - one.oracle_radius_mm) for one in errors):.3f} mm."
    )


MODEL_HEAD = [
    "elastic depth mm",
    "depth mm",
    "force %",
    "surface rms µm",
    "largest µm",
    "rms to the wall µm",
    "largest to the wall µm",
    "slope rms °",
    "contact radius mm",
    "the oracle's mm",
]


def markdown_table(head: list[str], body: list[list[str]]) -> str:
    """Rows of cells under a head."""
    rule = ["---"] * len(head)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, rule, *body])


def markdown(found: list[Row]) -> str:
    """The table, what is above a limit, and what the oracle's own mesh errs."""
    above = [text for row in found for text in exceeded(row)]
    return "\n\n".join(
        [
            f"Made with mujoco {version('mujoco')} and scikit-fem {version('scikit-fem')}.",
            markdown_table(MODEL_HEAD, [_model_row(row) for row in found]),
            "Above a limit: " + ("; ".join(above) if above else "nothing") + ".",
            _oracle_text(found),
        ]
    )


def comma_separated(found: list[Row]) -> str:
    """All figures of the table, six significant digits."""
    stream = io.StringIO()
    names = [f"{who}_{name}" for who in ("model", "oracle") for name in asdict(found[0].model)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["elastic_depth_mm", "depth_mm", *names])
    for row in found:
        values = [*asdict(row.model).values(), *asdict(row.oracle).values()]
        writer.writerow(
            [f"{row.elastic_depth_mm:g}", f"{row.depth_mm:g}", *(f"{value:.6g}" for value in values)]
        )
    return stream.getvalue()


def with_table(page: str, table: str, marks: tuple[str, str] = (BEGIN, END)) -> str:
    """The page with the text between two marks replaced."""
    begin, end = marks
    before, rest = page.split(begin)
    return f"{before}{begin}\n\n{table}\n\n{end}{rest.split(end)[1]}"


def write_tables(page: Path, made_by: str, tables: Mapping[str, Callable[[], str]], names: list[str]) -> None:
    """Write tables into a page, each between its marks: those of the given names, or all if there are none."""
    for name in names or tables:
        text = tables[name]()
        print(text, flush=True)
        marks = f"<!-- made by {made_by}: {name} -->", f"<!-- end of {name} -->"
        page.write_text(with_table(page.read_text(encoding="utf-8"), text, marks), encoding="utf-8")


def main(arguments: list[str]) -> None:
    """Make the table."""
    path = STORED
    if "--live" in arguments:
        path = BUILD / STORED.name
        build(Grading(), path)
    found = list(rows(path))
    table = markdown(found)
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table), encoding="utf-8")
    DATA.write_text(comma_separated(found), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Short tables of docs/validation that are taken from longer stored ones; `tests.validation.figures` writes them."""

from __future__ import annotations

from collections.abc import Callable

from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.stored import ROOT, Row, column, number, table

SHAPES = "tests/validation/light/shapes_table.md"
CROWNS = "tests/validation/contact/crown/crown_table.md"
OFFSETS = "tests/validation/contact/crown/offset_table.md"
ORACLE = "the oracle's mm"
SURFACE, MEAN = "surface to 3 radii: rms, largest µm", "mean: towards the apex, the rim µm"
PADS = {
    "fingertip": "fingertip dome, 5 mm off (sphere 18, wall 11, tip 2 mm)",
    "flat": "flat disc, 5 mm off (wall 11, tip 2 mm)",
    "dome": "steep dome, 4 mm off (sphere 14, wall 10, tip 3 mm)",
}


def shapes() -> str:
    """Light of discs, a stadium and crowned pads: a row a preset."""
    rows = table(SHAPES, "pad", "settings", "finer")
    head = ["preset", "worst of all pairs and states, joint standard errors"]
    head += ["changes at `score`: beyond the tracer's noise %", "that noise %"]
    head += ["against the engine's finest % (four presses)", "the same at `standard` %"]
    body = []
    for pad in dict.fromkeys(row["pad"] for row in rows):
        mine = [row for row in rows if row["pad"] == pad]
        pressed = [row for row in mine if row["press [mm]"] != "untouched"]
        score, standard = ([r for r in pressed if r["settings"] == name] for name in ("score", "standard"))
        noise = column(score, "noise")
        body.append(
            [
                pad,
                f"{max(column(mine, 'worst [joint standard errors]')):.1f}",
                f"0 to {max(column(score, 'change')):.2f}" if max(column(score, "change")) else "0",
                f"{min(noise):.1f} to {max(noise):.1f}",
                ", ".join(row["finer"] for row in score),
                ", ".join(row["finer"] for row in standard),
            ]
        )
    return markdown_table(head, body)


def apex() -> str:
    """Presses at the apex of two crowns."""
    head = [
        "crown, pad radius, rim mm",
        "depth mm",
        "force %",
        "surface, rms µm",
        "surface to the wall, largest µm",
    ]
    head += ["contact radius, the oracle's mm"]
    body = [
        [
            f"{row['crown mm']}, {row['pad mm']}, {number(row['rim mm']):.1f}",
            row["depth mm"],
            f"{number(row['force %']):+.1f}",
            row["surface rms µm"],
            row["largest to the wall µm"],
            f"{row['contact radius mm']}, {row[ORACLE]}",
        ]
        for row in table(CROWNS, "crown mm", "force %")
        if row["crown mm"] in ("40", "14")
    ]
    return markdown_table(head, body)


def beside() -> str:
    """Presses away from the apex, and what the oracle's coarser mesh changes."""
    rows = table(OFFSETS, "press", "thickness", "force %")
    head = ["pad", "depth mm", "force %", "surface to 3 tip radii, rms µm", "towards the apex, the rim µm"]
    head += ["the oracle's coarser mesh against its finer one: force %, surface µm"]
    body = []
    for pad, about in PADS.items():
        kind = "local" if pad == "flat" else "along the normal"
        for row in (row for row in rows if (row["press"], row["thickness"]) == (pad, kind)):
            coarse = _coarse(rows, row)
            body.append(
                [
                    about,
                    row["depth mm"],
                    row["force %"],
                    f"{number(row[SURFACE]):.0f}",
                    row[MEAN],
                    f"{number(coarse['force %']):.1f}, {number(coarse[SURFACE]):.0f}",
                ]
            )
    return markdown_table(head, body)


def _coarse(rows: list[Row], row: Row) -> Row:
    """The coarser mesh's row of the same press."""
    same = (row["press"], row["depth mm"], "the oracle's coarser mesh")
    return next(one for one in rows if (one["press"], one["depth mm"], one["thickness"]) == same)


SUMMARIES: dict[str, dict[str, Callable[[], str]]] = {
    "docs/validation/light.md": {"shapes": shapes},
    "docs/validation/contact-crowns.md": {"apex": apex, "beside": beside},
}
"""Page, name of a summary, and what makes it."""


def with_summaries(path: str) -> str:
    """The text of a page with its summaries as the stored tables say."""
    text = (ROOT / path).read_text(encoding="utf-8")
    for name, made in SUMMARIES[path].items():
        marks = f"<!-- made by tests/validation/summaries.py: {name} -->", f"<!-- end of {name} -->"
        text = with_table(text, made(), marks)
    return text

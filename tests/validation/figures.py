"""The figures that README and docs quote, each read from a stored result: docs/validation/figures.md.

    python -m tests.validation.figures          writes the page, and every quoted number anew

The page itself says what each figure is and in which unit: a new figure needs a row with its name there.

A quoted number has the name of its figure behind it as a comment, which no reader of the page sees:
`0.083<!--light.pad.rms--> %`. The command replaces the number where the stored result has changed. A figure's date is
the day on which its value last changed. `tests/docs/test_figures.py` finds quoted numbers that are out of date, and
measured numbers without a name.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

from optopad.design.io import write_text_atomically
from tests.validation import figures_of_models, figures_of_uses
from tests.validation.stored import ROOT, Figure, table
from tests.validation.summaries import SUMMARIES, with_summaries

PAGE = ROOT / "docs" / "validation" / "figures.md"
QUOTED = re.compile(r"(?P<number>[-+]?\d[\d,]*(?:\.\d+)?)<!--(?P<name>[a-z][\w.-]*)-->")

PARTS = (
    figures_of_models.contact,
    figures_of_models.walls,
    figures_of_models.objects,
    figures_of_models.sideways,
    figures_of_models.touches,
    figures_of_models.light,
    figures_of_models.renderer,
    figures_of_uses.paper,
    figures_of_uses.presets,
    figures_of_uses.learning,
    figures_of_uses.memory,
    figures_of_uses.driver,
    figures_of_uses.scene,
)

HEAD = """\
# Figures

README and docs quote these numbers. Each is read from a stored result, which `make validate` renews;
`python -m tests.validation.figures` then writes this page and every quoted number anew. The date is the day on
which the value last changed.

| name | figure | value | unit | source | date |
|---|---|---|---|---|---|
"""


def figures() -> list[Figure]:
    """Every figure, from the stored results as they are."""
    return [one for part in PARTS for one in part()]


def page_text(today: str) -> str:
    """The page of all figures: names, what they are and units as they stand there, values from the results.

    A figure with the value that the page has now keeps its date.
    """
    lines = []
    values = {one.name: one for one in figures()}
    for row in table(PAGE.relative_to(ROOT).as_posix(), "name", "date"):
        one = values.pop(row["name"].strip("`"))
        date = row["date"] if row["value"] == one.value else today
        lines.append(
            f"| `{one.name}` | {row['figure']} | {one.value} | {row['unit']} | `{one.source}` | {date} |\n"
        )
    if values:
        raise ValueError(f"{PAGE.name} needs a row that says what each is, and its unit: {', '.join(values)}")
    return HEAD + "".join(lines)


def quoting() -> list[Path]:
    """Pages that may quote figures."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def quoted_anew(text: str, values: dict[str, str]) -> str:
    """A page with every quoted number as its figure says; a plus sign before a number without a sign stays."""

    def anew(found: re.Match[str]) -> str:
        value = values[found["name"]]
        sign = "+" if found["number"].startswith("+") and value[0].isdigit() else ""
        return f"{sign}{value}<!--{found['name']}-->"

    return QUOTED.sub(anew, text)


def main() -> None:
    """Write the page of figures, the summaries, and the numbers of all pages that quote figures."""
    write_text_atomically(PAGE, page_text(datetime.now(tz=UTC).date().isoformat()))
    for name in SUMMARIES:
        write_text_atomically(ROOT / name, with_summaries(name))
    values = {one.name: one.value for one in figures()}
    for path in quoting():
        text = path.read_text(encoding="utf-8")
        if (new := quoted_anew(text, values)) != text:
            write_text_atomically(path, new)


if __name__ == "__main__":
    main()

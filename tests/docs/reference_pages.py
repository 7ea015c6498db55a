"""The pages that the program's own texts fill: every verb, every field of a design file, tables of the catalogue.

    python -m tests.docs.reference_pages          writes the files of `PAGES` and docs/images/presets/*.svg

The pages are files of the repository, so that they can be read without building the site. A page begins with text
written by hand. Everything between the lines `MADE` and `END`, or to the end of the page, comes from help texts, the
schema and the catalogue.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from optopad.design.io import write_text_atomically
from optopad.design.preset import PRESETS, preset
from tests.docs.circuit_tables import boards_table, converters_table
from tests.docs.command_text import every_verb
from tests.docs.field_text import every_field
from tests.docs.preset_table import preset_picture, presets_table

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
MADE = "<!-- made by python -m tests.docs.reference_pages; change the program's texts instead -->"
END = "<!-- end -->"
PAGES: dict[str, Callable[[], str]] = {
    "commands.md": every_verb,
    "design-fields.md": every_field,
    "../how-to/index.md": presets_table,
    "../how-to/program-board.md": boards_table,
    "../how-to/board-options.md": converters_table,
}
PICTURES = FOLDER.parent / "images" / "presets"


def page_text(name: str) -> str:
    """A page as it should be: head and tail as they are written, the rest as the program says today."""
    written = (FOLDER / name).read_text(encoding="utf-8")
    if MADE not in written:
        raise ValueError(
            f"docs/reference/{name}: has no line {MADE}; put it back below the text written by hand"
        )
    head, _, rest = written.partition(MADE)
    tail = "".join(rest.partition(END)[1:])
    return f"{head}{MADE}\n\n{PAGES[name]().rstrip()}\n" + (f"\n{tail}" if tail else "")


def main() -> None:
    """Write the pages and the pictures."""
    for name in PAGES:
        write_text_atomically(FOLDER / name, page_text(name))
    for name in PRESETS:
        write_text_atomically(PICTURES / f"{name}.svg", preset_picture(preset(name)))


if __name__ == "__main__":
    main()

"""The pages of the reference that the program's own texts fill: every verb, and every field of a design file.

    python -m tests.docs.reference_pages          writes docs/reference/commands.md and docs/reference/design-fields.md

The pages are files of the repository, so that they can be read without building the site. A page begins with text
written by hand; all below the line `MADE` comes from help texts and from the schema.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from design.io import write_text_atomically
from tests.docs.command_text import every_verb
from tests.docs.field_text import every_field

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
MADE = "<!-- made by python -m tests.docs.reference_pages; change the program's texts instead -->"
PAGES: dict[str, Callable[[], str]] = {"commands.md": every_verb, "design-fields.md": every_field}


def page_text(name: str) -> str:
    """A page as it should be: its head as it is written, the rest as the program says today."""
    written = (FOLDER / name).read_text(encoding="utf-8")
    if MADE not in written:
        raise ValueError(
            f"docs/reference/{name}: has no line {MADE}; put it back below the text written by hand"
        )
    return f"{written.partition(MADE)[0]}{MADE}\n\n{PAGES[name]().rstrip()}\n"


def main() -> None:
    """Write both pages."""
    for name in PAGES:
        write_text_atomically(FOLDER / name, page_text(name))


if __name__ == "__main__":
    main()

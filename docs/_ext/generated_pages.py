"""Fills two pages of the reference from the program when the site is built; none of it is kept in the sources.

A page has a line of its own with a placeholder, `<!-- every verb -->` or `<!-- every field -->`, in place of which the
text comes. What it says is what this checkout of the program says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from command_text import every_verb
from field_text import every_field

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FILLED: dict[str, tuple[str, Callable[[], str]]] = {
    "reference/commands": ("<!-- every verb -->", every_verb),
    "reference/design-fields": ("<!-- every field -->", every_field),
}
"""Page, its placeholder, and what makes the text."""


def filled(page: str, text: str) -> str:
    """The text of a page with its placeholder replaced; other pages as they are."""
    if page not in FILLED:
        return text
    placeholder, made = FILLED[page]
    if placeholder not in text:
        raise ValueError(f"docs/{page}.md: has no line {placeholder}; put it back where the text belongs")
    return text.replace(placeholder, made())


def _fill(_: Sphinx, page: str, source: list[str]) -> None:
    source[0] = filled(page, source[0])


def _always_read(*_: object) -> list[str]:
    """The program may have changed where the page's own source has not."""
    return list(FILLED)


def setup(app: Sphinx) -> dict[str, bool]:
    """Join the build."""
    app.connect("source-read", _fill)
    app.connect("env-get-outdated", _always_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

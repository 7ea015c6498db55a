"""The files that pages are made of, and the page that needs no script."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from importlib.resources import files
from string import Template

from optopad.report.text.markup import Html, bullets, element, joined


def asset(name: str) -> str:
    """The text of a file of `optopad/report/assets`."""
    return (files("optopad.report.assets") / name).read_text(encoding="utf-8")


def still_page(
    what: str, name: str, digest: str, titles: Mapping[str, str], verdict: Html, sections: Iterable[Html]
) -> str:
    """The whole page as HTML text; `titles` name the sections by their anchors."""
    links = bullets([element("a", title, href=f"#{anchor}") for anchor, title in titles.items()])
    return Template(asset("still_page.html")).substitute(
        title=escape(f"{name}: {what}"),
        style=asset("page.css"),
        kind=f"{what} report",
        name=escape(name),
        digest=escape(digest[:8]),
        navigation=element("nav", links, aria_label="Parts of this page"),
        verdict=verdict,
        sections=joined(sections, "\n"),
    )

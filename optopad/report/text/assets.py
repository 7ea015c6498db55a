"""The files that pages are made of, the page that needs no script, and the one script of the others.

The policy of a page lets that script run and no other. Every part of it looks for its own elements and does nothing
without them. Data for it is stored in the page as JSON, which a browser reads and does not run; a closing tag inside
is escaped.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from optopad.report.text.markup import Html, bullets, element, joined

PARTS = ("theme.js", "plan.js", "pad.js", "solid.js", "rays_view.js", "pairs_view.js", "maps_view.js")


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


def script_text() -> str:
    """All parts one after the other."""
    return "\n".join(map(asset, PARTS))


def script_policy() -> str:
    """The part of the page's policy that lets the script run, by its hash."""
    digest = base64.b64encode(hashlib.sha256(script_text().encode()).digest()).decode("ascii")
    return f"; script-src 'sha256-{digest}'"


def script_element() -> Html:
    """The script, for the end of the page."""
    return element("script", Html(script_text()))


def data_element(identifier: str, data: Any) -> Html:
    """Data for the script.

    Parameters
    ----------
    data : what JSON can hold; no NaN and no infinity
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return element("script", Html(text.replace("<", "\\u003c")), type="application/json", id=identifier)

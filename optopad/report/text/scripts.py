"""The page's one script, its parts in order, and the policy that lets it and no other run.

Every part looks for its own elements and does nothing without them. Data for it lie in the page as JSON, which a
browser reads and does not run; a closing tag inside them is escaped.
"""

from __future__ import annotations

import base64
import hashlib
import json
from typing import Any

from optopad.report.text.assets import asset
from optopad.report.text.markup import Html, element

PARTS = ("theme.js", "plan.js", "pad.js", "solid.js", "rays_view.js", "pairs_view.js", "maps_view.js")


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

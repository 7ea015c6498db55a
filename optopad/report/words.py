"""What all pages have in common: their templates, their script, and the judged pairs in order.

Templates are in `optopad/report/templates`. Values in them are escaped, so the content of a design file remains text.

Script: the security policy of a page allows this script and no other. Each part of the script looks for its own
elements and does nothing if they are missing. Its data are stored in the page as JSON, which a browser does not
execute; closing tags in the data are escaped.
"""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from optopad.fabrication.sheets.template import filled
from optopad.screen.answer import counted
from optopad.screen.verdict_sentences import depth, ends, signed, spans
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.depth_curve import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD

PARTS = ("theme.js", "plan.js", "pad.js", "solid.js", "rays_view.js", "pairs_view.js", "maps_view.js")
IN_ALL: dict[str, Any] = {
    "counted": counted,
    "deadband_mm": DEADBAND_MIN_LENGTH_MM,
    "deadband_sigma": DEADBAND_THRESHOLD,
    "depth": depth,
    "ends": ends,
    "signed": signed,
    "spans": spans,
}
"""Values that every template may use."""


def part(template: str, **values: Any) -> Markup:
    """A page or a part of it as HTML, from `templates/<template>.html.j2`."""
    return Markup(filled("optopad.report", f"{template}.html.j2", IN_ALL | values))


def asset(name: str) -> Markup:
    """The text of a file in `optopad/report/assets`, for a page."""
    return Markup((files("optopad.report.assets") / name).read_text(encoding="utf-8"))


def inlined(svg: str) -> Markup:
    """A drawing as part of a page, without the text before its ``<svg`` tag."""
    return Markup(svg[svg.index("<svg") :])


def script_text() -> Markup:
    """All parts of the script, one after the other."""
    return Markup("\n").join(map(asset, PARTS))


def script_policy() -> Markup:
    """The part of the page's security policy that allows the script, identified by its hash."""
    digest = base64.b64encode(hashlib.sha256(script_text().encode()).digest()).decode("ascii")
    return Markup(f"; script-src 'sha256-{digest}'")


def ranked(score: ContinuityScore) -> list[JudgedPair]:
    """Judged pairs from worst to best: most deadband first, then least evenness."""
    return sorted(score.pairs, key=lambda pair: (-pair.score.deadband_total_mm, pair.score.evenness))


def governing(score: ContinuityScore) -> JudgedPair:
    """The governing pair: the one that represents all pairs."""
    return next(pair for pair in score.pairs if pair.name == score.governing)


def reading(pair: JudgedPair) -> str:
    """Sentence on one pair's curves: gap or overlap of the modes, deadbands, and clipping."""
    gap, dead = pair.score.modes.gap_mm, pair.score.deadbands_mm
    if gap is None:
        apart = "Mode 2 does not begin within the depth"
    else:
        apart = f"The modes overlap by {-gap:.2f} mm" if gap < 0 else f"The modes are {gap:.2f} mm apart"
    said = f"{apart}; {'deadband ' + spans(dead) + ' mm' if dead else 'no deadband'}."
    if pair.score.is_clipped:
        share = f"{pair.score.clipped_share:.0%} of the depth"
        said += f" {pair.name} reads above full scale over {share} and resolves nothing there."
    return said

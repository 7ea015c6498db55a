"""Small designs of parts whose sizes are round numbers, for tests of the rules."""

from __future__ import annotations

from typing import Any

from optopad.design.fields.finding import Finding
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from tests.design.spec.spec_fields import with_layout

BENCHMARK = {"emitters.part": "generic-emitter", "receivers.part": "generic-receiver"}
"""Parts by definition: bodies 3.0 and 4.0 mm wide, 1.5 mm deep."""


def facing(count: int = 2, pitch_mm: float = 10.0) -> dict[str, Any]:
    return {"pattern": "facing_rows", "count": count, "pitch_mm": pitch_mm}


def single(kind: str, wall: str, along_mm: float, **more: Any) -> dict[str, Any]:
    return {"pattern": "single", "kind": kind, "wall": wall, "along_mm": along_mm, **more}


def and_more(*patterns: dict[str, Any], **changes: Any) -> SensorDesign:
    """Parts by definition on three walls, without a fault; then more patterns, from `layout.3` on."""
    base = [facing(), single("emitter", "north", 12.0), single("receiver", "north", 20.0)]
    return with_layout(*base, *patterns, **BENCHMARK, **changes)


def only(design: SensorDesign) -> Finding:
    """The one finding of a design."""
    findings = check(design)
    assert len(findings) == 1, [str(finding) for finding in findings]
    return findings[0]


def about(design: SensorDesign, words: str) -> Finding:
    """The one finding whose message holds these words."""
    found = [finding for finding in check(design) if words in finding.message]
    assert len(found) == 1, [str(finding) for finding in check(design)]
    return found[0]

"""Designs with a part of the user's own, for tests: a packaged part with options added."""

from __future__ import annotations

import json
from typing import Any, Literal

from optopad.design.parts import catalog
from optopad.design.spec import SensorDesign
from tests.design.spec.spec_fields import good

BASE = {"emitter": "generic-emitter", "receiver": "osram-sfh206k"}
SHEET = {"source": "sheet, fig. 3", "confidence": "read"}


def own_part(kind: Literal["emitter", "receiver"], **options: Any) -> dict[str, Any]:
    """A packaged part as plain data, with options added."""
    fields = json.loads(catalog.packaged().parts[BASE[kind]].model_dump_json(exclude_none=True))
    return fields | options


def with_own_part(
    kind: Literal["emitter", "receiver"], changes: dict[str, Any] | None = None, **options: Any
) -> SensorDesign:
    """The good design with all emitters or all receivers of an own part."""
    paths = {name: options.pop(name) for name in list(options) if "." in name}
    parts = {"parts": {"mine": own_part(kind, **options)}}
    return good(**{"catalog": parts, f"{kind}s.part": "mine"}, **(changes or {}), **paths)


def quantity(value: float, unit: str) -> dict[str, Any]:
    """A measured value as plain data."""
    return {"value": value, "unit": unit, "source": "bench", "confidence": "measured"}

"""Fixtures of the report's tests."""

from __future__ import annotations

from typing import Any

import pytest

from optopad.design.errors import ModelScopeError
from optopad.report.sections import drawings, early


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages with their words, tables and names of plots, but without ink on the plots and without traced light."""

    def no_light(*_: Any, **__: Any) -> None:
        raise ModelScopeError("not traced in this test")

    monkeypatch.setattr(drawings, "svg_text", lambda *_: '<svg viewBox="0 0 1 1"></svg>\n')
    monkeypatch.setattr(early, "ray_scene", no_light)

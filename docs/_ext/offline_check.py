"""Warns, and so fails the build, where a page would fetch a script, a style, a font or a picture from another site."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from sphinx.util import logging

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FETCHED = re.compile(
    r"""<(?:script|img|iframe|source|video|audio)\b[^>]*?\bsrc\s*=\s*["']?(?:https?:)?//[^"'\s>]+"""
    r"""|<link\b(?=[^>]*\brel\s*=\s*["']?(?:stylesheet|preload|icon))[^>]*?\bhref\s*=\s*["']?(?:https?:)?//[^"'\s>]+"""
)
"""In a page: what a browser loads by itself."""

IMPORTED = re.compile(r"""(?:@import\s+|url\()\s*["']?(?:https?:)?//[^"')\s]+""")
"""In a style sheet."""


def fetched_from_elsewhere(text: str, *, is_style: bool = False) -> list[str]:
    """What a page or a style sheet would load from another site."""
    return (IMPORTED if is_style else FETCHED).findall(text)


def _check(app: Sphinx, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    log = logging.getLogger(__name__)
    for path in sorted(Path(app.outdir).rglob("*")):
        if path.suffix in {".html", ".css"}:
            text = path.read_text(encoding="utf-8")
            for found in fetched_from_elsewhere(text, is_style=path.suffix == ".css"):
                log.warning("%s: loads from another site: %s", path.relative_to(app.outdir), found)


def setup(app: Sphinx) -> dict[str, bool]:
    """Join the build."""
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

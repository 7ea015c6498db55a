"""A user's text inside Markdown."""

from __future__ import annotations

import re

from fabrication.sheets.formats.table import one_line


def plain(text: str) -> str:
    """A user's text on one line, with Markdown's and HTML's own signs made harmless."""
    return re.sub(r"([\\`*_{}\[\]<>#|~])", r"\\\1", one_line(text)).replace("\\<", "&lt;")

"""Prints texts of the product and of the docs that have a word with a plainer one: `python -m tests.plain_words`.

A warning of `make lint`, never an error. Code, names, docstrings and the pages made from help texts are left out.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("design", "cad", "sims", "fabrication", "optopad")
MADE_PAGES = ("commands.md", "design-fields.md")
UNCLEAR = re.compile(
    r"\b(?:tells?|told|telling|felt|blind|worth|un?sure|heed\w*|errands?|knobs?|wish\w*|mend\w*|faded|fades|"
    r"used up|spent|nobody|give or take|beside|open values?)\b",
    re.IGNORECASE,
)
NAMES = re.compile(r"^\w+:|`[^`]*`|'\w+'|--[\w-]+|\S*[a-z0-9]_[a-z]\S*|\S+\.\S+")


def literals(file: Path) -> Iterator[str]:
    """Texts of a Python file with more than two words (keys have fewer), without docstrings and compared texts."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    skipped = ast.Compare | ast.MatchValue | ast.Expr
    unread = {
        id(one) for node in ast.walk(tree) if isinstance(node, skipped) for one in ast.iter_child_nodes(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in unread:
            yield from [node.value] if len(node.value.split()) > 2 else []


def texts() -> Iterator[tuple[Path, str]]:
    """File and text, product first."""
    for room in ROOMS:
        for file in sorted((ROOT / room).rglob("*.py")):
            yield from ((file, text) for text in literals(file))
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        if page.name not in MADE_PAGES:
            plain = re.sub(
                r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
            )
            yield from ((page, line) for line in plain.splitlines())


if __name__ == "__main__":
    for path, text in texts():
        if found := UNCLEAR.search(NAMES.sub("", text)):
            print(f"warning: {path.relative_to(ROOT)}: {found.group()!r} in: {text.strip()[:90]}")

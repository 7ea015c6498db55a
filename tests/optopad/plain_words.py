"""The words that no text for users has, and the texts of the product that users read."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
ROOMS = ("design", "cad", "sims", "fabrication", "optopad")
NOT_SAID = re.compile(
    r"\b(?:tells?|told|telling|felt|blind|worth|un?sure|sure|heed\w*|weakest|errands?|doing|knobs?|wish\w*|mend\w*|"
    r"faded|fades|used up|spent|firm|nobody|turns|turned|give or take|beside|asked|noise units?|open values?|places?|"
    r"stands|lies in|goes|wants|wanted|lever|(?:light )?trace(?:'s)? error|light trace|builds|"
    r"(?:the|an?|this|each) build)\b",
    re.IGNORECASE,
)
"""Others say the same in the field's own terms."""
NAMES = re.compile(r"^\w+:|`[^`]*`|'\w+'|--[\w-]+|\S*[a-z0-9]_[a-z]\S*|\S+\.\S+")
"""Arguments that a message begins with, commands and columns in quotes, options, fields, parts and files."""
KEPT = {
    "doubtful places",  # keys of stages, whose titles are read instead
    "mold beside",
    "open places",
    "open value",  # an origin in JSON
    "used up",  # a cause in JSON
    "two grid sets to train on, two random sets of 20 places to test on, fewer depths",  # in a protocol's digest
}


def words_of(text: str) -> list[str]:
    """Words of the list in a text, less names."""
    return [] if text in KEPT else NOT_SAID.findall(NAMES.sub("", text))


def texts_of(root: Path = ROOT) -> Iterator[tuple[str, str]]:
    """File and text of everything that a user may read in the product."""
    for room in ROOMS:
        for file in sorted((root / room).rglob("*")):
            for text in READERS.get(file.suffix, _none)(file):
                yield file.relative_to(root).as_posix(), text


def literals_of(file: Path) -> Iterator[str]:
    """Texts of a Python file with more than one word, less docstrings, keys, classes and names that are compared."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    left_out = {id(part) for node in ast.walk(tree) for top in _unread(node) for part in ast.walk(top)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in left_out:
            yield from (text for text in (node.value,) if isinstance(text, str) and " " in text)


def _unread(node: ast.AST) -> list[ast.AST]:
    match node:
        case ast.Expr(value=ast.Constant()) | ast.Compare() | ast.MatchValue():
            return [node]
        case ast.Dict(keys=keys):
            return [key for key in keys if key is not None]
        case ast.keyword(arg="class_"):
            return [node]
    return []


def _toml(file: Path) -> Iterator[str]:
    text = file.read_text(encoding="utf-8")
    yield from (line.partition("#")[2] for line in text.splitlines() if "#" in line)
    yield from _strings(tomllib.loads(text))


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _strings(inner)


def _script(file: Path) -> Iterator[str]:
    text = re.sub(r"//[^\n]*", "", file.read_text(encoding="utf-8"))
    found = re.findall(r'"([^"\n]*)"|[`}]([^`${}";\n]*)(?=`|\$\{)', text)
    yield from (part for parts in found for part in parts if " " in part)


def _page(file: Path) -> list[str]:
    found = re.findall(r">([^<]+)<|(?:title|label)=\"([^\"]*)\"", file.read_text(encoding="utf-8"))
    return [text for pair in found for text in pair]


def _comments(file: Path) -> list[str]:
    return re.findall(r"/\*.*?\*/|#error .*", file.read_text(encoding="utf-8"), flags=re.DOTALL)


def _none(_: Path) -> list[str]:
    return []


READERS = {
    ".py": literals_of,
    ".toml": _toml,
    ".js": _script,
    ".html": _page,
    **dict.fromkeys((".c", ".h"), _comments),
}

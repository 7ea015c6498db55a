"""What a verb says: lines for people, or one JSON object for machines."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

import typer


def tell(as_json: bool, document: Callable[[], dict[str, Any]], lines: Callable[[], Iterable[str]]) -> None:
    """What was found or made: one JSON object with ``--json``, else lines for people."""
    if as_json:
        print_json(document())
    else:
        say("\n".join(lines()))


def print_json(document: dict[str, Any]) -> None:
    """One JSON object on standard output; an open end is null, never Infinity."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def say(text: str = "") -> None:
    """A line for people on standard output."""
    typer.echo(text)

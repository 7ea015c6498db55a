"""Verbs called in the tests' own process share one tree of commands, which takes longer to make than most verbs run."""

from __future__ import annotations

from functools import cache

import typer.main

typer.main.get_command = cache(typer.main.get_command)

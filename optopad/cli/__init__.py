"""The command line: one file per group of verbs; heavy imports happen inside the verbs."""

from optopad.cli.main import main

__all__ = ["main"]

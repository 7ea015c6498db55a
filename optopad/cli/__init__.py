"""The command line: one file a group of verbs; heavy imports happen inside the verbs."""

from optopad.cli.main import main

__all__ = ["main"]

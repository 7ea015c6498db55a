"""The command line: one file per group of commands, which import large packages only when they run."""

from optopad.cli.main import main

__all__ = ["main"]

"""The command line: one file per group of commands; slow imports happen inside the commands."""

from optopad.cli.main import main

__all__ = ["main"]

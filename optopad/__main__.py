"""Runs the command line as `python -m optopad`, for a machine where the program `optopad` is not on the path."""

from optopad.cli import main

main()

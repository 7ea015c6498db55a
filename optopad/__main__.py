"""`python -m optopad`: the command line where the command itself is not on the path."""

from optopad.cli import main

main()

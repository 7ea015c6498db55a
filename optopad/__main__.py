"""`python -m optopad`: the command line for a machine where `optopad` itself is not on the path."""

from optopad.cli import main

main()

"""The work of each command, without the terminal: from a design or data to a filled bundle.

Imports within this repository: report, screen, work and what these import.
"""

"""The work of each command, without the terminal: from a design or data to a filled bundle.

Project imports: report, results, screen, work and what these import.
"""

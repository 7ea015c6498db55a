"""The work of each command, without the terminal: from a design or data to a filled bundle.

Imports of ours: report, results, screen, work and the rooms below.
"""

"""The work of each verb, without the terminal: a design or data in, a bundle filled.

Imports of ours: report, results, screen, work and the rooms below.
"""

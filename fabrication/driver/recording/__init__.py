"""Frames on disk: the raw file that survives a crash, export, labels, and clocks that are matched.

Imports of ours: link, simulated, the driver file.
"""

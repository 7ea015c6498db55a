"""Frames on disk: the crash-safe raw file, export, labels, and matching of clocks.

Imports within this repository: link, simulated, the driver file.
"""

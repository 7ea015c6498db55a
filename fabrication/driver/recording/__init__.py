"""Frames on disk: the crash-safe raw file, export, labels, and matching of clocks.

Imports of ours: link, simulated, the driver file.
"""

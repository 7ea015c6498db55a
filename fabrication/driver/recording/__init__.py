"""Frames on the disk: a raw file that survives crashes, its export, labels of presses, and matching of clocks.

Imports within this repository: link, simulated, the driver file.
"""

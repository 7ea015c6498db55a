"""Frames on the disk: a raw file that survives crashes, its export, labels of presses, and matching of clocks.

Project imports: link, simulated, the driver file.
"""

"""Fisher information of the signals, and Cramér-Rao bounds of a press's location and depth.

This package imports `optopad.sims.verdict` and the packages that `optopad.sims.verdict` imports.
"""

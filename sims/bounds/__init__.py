"""Fisher information of the signals, and Cramér-Rao bounds of a press's location and depth.

It imports verdict and the rooms below it.
"""

"""What the signals can tell at best: Fisher information and Cramér-Rao bounds of a press's place and depth.

Imports of ours: verdict and below.
"""

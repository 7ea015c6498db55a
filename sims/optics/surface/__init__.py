"""The pressed top: a curve around each tip, the sum of the curves, and the grid on this sum.

It imports scene and press.
"""

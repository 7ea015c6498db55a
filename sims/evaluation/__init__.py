"""How well a press is told: predictions held against presses, in the tables of the paper.

Imports of ours: learning, bounds, verdict and below.
"""

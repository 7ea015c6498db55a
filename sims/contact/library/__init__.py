"""Solved presses, shipped and kept, and the smooth interpolation between them.

Imports of ours: solver, walls, and the tip and the scope of `sims.contact`.
"""

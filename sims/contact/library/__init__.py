"""Solved presses, shipped and cached, and the smooth interpolation between them.

It imports solver, walls, and the tip and the scope of `sims.contact`.
"""

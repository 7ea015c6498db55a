"""MuJoCo presses a tip into soft rubber: wedge, block, meshes, and the checks of each solve.

Imports of ours: the tip and the scope of `sims.contact`.
"""

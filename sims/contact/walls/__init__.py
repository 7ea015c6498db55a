"""What near walls change of a press: force and surface, from three-dimensional runs.

Imports of ours: solver, and the tip and the scope of `sims.contact`.
"""

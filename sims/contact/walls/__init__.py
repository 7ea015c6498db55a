"""What the walls of a rectangular pad change of a press: a linear incompressible layer, solved once a design.

Imports of ours: none.
"""

"""The shape of a pad: outline and top, the parts around it, the pairs across it.

`outline` and `top` know nothing of designs. Imports of ours: spec and below.
"""

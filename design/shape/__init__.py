"""The shape of a pad: its outline and top, the parts around it, and the pairs across it.

`outline` and `top` do not depend on designs. Imports of ours: spec and below.
"""

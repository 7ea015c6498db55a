"""What becomes of light, for pictures: sample paths, kinds of light, the power of each.

Imports of ours: optics, contact, press.
"""

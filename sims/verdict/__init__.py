"""The rules of the verdict: presses, modes, deadbands, builds, the map of the pad.

Imports of ours: readings, optics, contact, press. `pair` has the rules of one pair.
"""

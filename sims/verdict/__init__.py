"""The rules of the verdict: presses, modes, deadbands, manufactured units, the map of the pad.

It imports readings, optics, contact and press. `pair_score` has the rules of one pair.
"""

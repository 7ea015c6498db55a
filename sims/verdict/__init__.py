"""The rules of the verdict: presses, modes, deadbands, manufactured units, and the map of the pad's resolution.

This package imports `optopad.sims.readings`, `optopad.sims.optics`, `optopad.sims.contact` and `optopad.sims.press`.
The rules for one pair are in `pair_score`.
"""

"""The rules of the verdict: presses, modes, deadbands, manufactured units, and the map of the pad's resolution.

This package imports `sims.readings`, `sims.optics`, `sims.contact` and `sims.press`. The rules for one pair are in
`pair_score`.
"""

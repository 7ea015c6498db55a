"""The parts of a verdict: presses, modes, deadbands, continuity, strength, the map of the pad."""

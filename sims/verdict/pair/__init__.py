"""What one pair tells under one press: modes, deadbands, noise, strength; from its readings alone.

Imports of ours: design.errors.
"""

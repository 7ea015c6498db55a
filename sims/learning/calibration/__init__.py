"""Fitting the twin to a build: unknown optical parameters and gains from a few real presses."""

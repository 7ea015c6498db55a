"""Presses told by the simulated signals themselves: the traced map, and the model made of it.

Imports of ours: fits, samples, inference, optics, contact.
"""

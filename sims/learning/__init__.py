"""Learning: from signals to touch, place and depth. Training is here, what answers on any computer in `inference`.

Imports of ours: bounds, readings, optics, contact.
"""

"""Learning: from signals to touch, location and depth. Training is here; `inference` runs on any computer.

It imports bounds, readings, optics and contact.
"""

"""Learning: from signals to touch, location and depth. Training is here; `inference` needs only numpy.

It imports bounds, readings, optics and contact.
"""

"""Light of pads with a form: tops in the frame of the press, straight, mirrored and scattered light.

Imports of ours: surface, scene and below.
"""

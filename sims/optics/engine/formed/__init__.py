"""Light of pads with a form: tops in the frame of the press, direct, mirrored and scattered light.

It imports surface, scene and the rooms below them.
"""

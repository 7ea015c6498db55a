"""Light of disc and crowned pads: tops in press coordinates; direct, mirrored and scattered light.

It imports surface, scene and the rooms below them.
"""

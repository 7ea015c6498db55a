"""Light that the top mirrors once, total reflection included: image by image, path by path. Kernels.

Imports of ours: straight, surface.
"""

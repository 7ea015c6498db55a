"""Light that walls, bottom or tip scatter, and light that the top mirrors several times. Kernels.

Imports of ours: straight, surface.
"""

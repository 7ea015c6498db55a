"""Light that no surface mirrors, and what stands in its way. Kernels.

Imports of ours: surface.
"""

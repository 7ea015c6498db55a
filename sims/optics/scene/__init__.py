"""A design as arrays for all kernels and the oracle: positions, materials, emission, acceptance, symmetry.

It imports press and, in `lower` and `optical_scene` alone, design.
"""

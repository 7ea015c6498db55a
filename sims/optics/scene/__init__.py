"""A design as arrays for all kernels: positions, materials, emission, acceptance, symmetry.

It imports press and, in `lower` and `optical_scene` alone, design.
"""

"""A design as arrays that every kernel and the oracle read: positions, materials, emission, acceptance, symmetry.

It imports press; design (in `lower` and `optical_scene` alone).
"""

"""A design as arrays that every kernel and the oracle read: places, materials, emission, acceptance, symmetry.

Imports of ours: press; design (in `lower` and `acceptance` alone).
"""

"""Numeric model of the mold before any solid is made: outline, sockets, webs, filling, letters.

Imports of ours: shape and below.
"""

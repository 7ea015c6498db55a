"""The mold as plain numbers: outline, sockets, webs, filling, letters; before any solid is made.

Imports of ours: shape and below.
"""

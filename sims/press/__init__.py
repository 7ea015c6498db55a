"""One press as plain data: the shape of the deformed top, depths, places.

Imports nothing of ours.
"""

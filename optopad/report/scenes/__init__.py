"""The views of a page, as data and as still pictures: pad, pairs, rays, mold.

Imports of ours: text and the rooms below.
"""

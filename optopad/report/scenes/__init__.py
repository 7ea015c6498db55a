"""The views of a page, as data and as still pictures: pad, pairs, rays, mold.

It may import design, sims and cad.
"""

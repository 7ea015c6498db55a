"""From a design to its signals and its verdict.

Rooms, from the ground up: press, cache, contact, optics, rays, readings, verdict, bounds, continuity;
learning and evaluation beside them; plots on top. Imports of ours: design.
"""

"""Design to signals to verdict.

Rooms, from the ground up: press, cache, contact, optics, rays, readings, verdict, bounds, continuity;
learning and evaluation beside them; plots on top. Imports of ours: design.
"""

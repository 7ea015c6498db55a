"""From a design to its signals and its verdict.

Rooms, from the ground up: contact, optics, readings, verdict, bounds, continuity; learning beside them; plots on top.
Imports of ours: design.
"""

"""What an optopad sensor is: its specification, parts and geometry, and whether it can be built.

Rooms, from the ground up: fields, parts, spec, geometry, circuit, rules; beside them protocols and search.
Imports nothing of the other rooms.
"""

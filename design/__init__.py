"""What an optopad sensor is: its specification, parts and geometry, and whether it can be built.

Rooms, from the ground up: fields, parts, spec, shape, mold, circuit, rules; beside them search.
Imports nothing of the other rooms.
"""

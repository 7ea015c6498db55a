"""The serial line to the board: ports, messages, checksums, complete frames.

Imports within this repository: the driver file, optopad.design.errors.
"""

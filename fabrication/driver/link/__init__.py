"""The serial line to the board: ports, messages, checksums, complete frames.

Imported project modules: the driver file, design.errors.
"""

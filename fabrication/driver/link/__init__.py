"""The serial line: ports, messages, checksums, complete frames.

Imports within this repository: the driver file, design.errors.
"""

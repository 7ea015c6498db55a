"""The serial line: ports, messages, checksums, complete frames.

Imports of ours: the driver file, design.errors.
"""

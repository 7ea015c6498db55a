"""The serial line: ports, messages, checksums, whole frames.

Imports of ours: the driver file, design.errors.
"""

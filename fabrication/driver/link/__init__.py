"""The serial line to the board: ports, messages, checksums, complete frames.

Project imports: the driver file, design.errors.
"""

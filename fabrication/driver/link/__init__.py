"""The serial line to the board: ports, messages, checksums, complete frames.

Project modules that it imports: the driver file, design.errors.
"""

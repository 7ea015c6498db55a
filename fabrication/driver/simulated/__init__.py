"""A simulated board on a serial port, with a moving finger, its signals, and faults of the unit on request.

Imports within this repository: link, the driver file.
"""

"""A simulated board on a serial port, with a moving finger, its signals, and faults of the unit on request.

Project modules that it imports: link, the driver file.
"""

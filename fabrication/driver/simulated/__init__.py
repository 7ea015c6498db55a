"""A simulated board: a moving finger, its signals, and faults on request.

Imports within this repository: link, the driver file.
"""

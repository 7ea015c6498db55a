"""A simulated board: a moving finger, its signals, and faults on request.

Imports of ours: link, the driver file.
"""

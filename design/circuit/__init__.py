"""Pins, amplifiers, switches and frame times that follow from the parts and the board.

Imports of ours: geometry and below.
"""

"""Pins, amplifiers, switches and frame times, computed from the parts and the board of a design.

The package imports only `optopad.design.shape` and packages below it.
"""

"""Numeric model of the mold before any CAD solid is made: outline, sockets, webs, filling and lettering.

The package imports only `optopad.design.shape` and packages below it.
"""

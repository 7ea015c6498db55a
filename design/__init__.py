"""Specification of an optopad sensor: its fields, parts and geometry, and the rules of manufacture.

Its packages, lowest first, are fields, parts, spec, shape, mold, circuit and rules, and next to them search.
It imports no other room.
"""

"""Specification of an optopad sensor: its fields, parts and geometry, and the rules of manufacture.

Each of the packages fields, parts, spec, shape, mold, circuit and rules imports only those before it. The package
search uses them to explore designs. No module imports from another top-level package of the project.
"""

"""Specification of an optopad sensor: its fields, parts and geometry, and the rules of manufacture.

Of the packages fields, parts, spec, shape, mold, circuit and rules, each imports only the ones listed before it. The
package search uses them to explore designs. No module imports from another top-level package of the project.
"""

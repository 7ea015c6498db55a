"""Elements of every field of a specification: unit, source, range, dotted path and findings; and packaged tables.

The package imports only `optopad.design.errors` and other modules directly in `design`.
"""

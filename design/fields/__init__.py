"""Elements of every field of a specification: unit, source, range, dotted path, findings; and packaged tables.

Imports of ours: errors.
"""

"""What every field of a specification is made of: unit, source, range, dotted path, findings; and packaged tables.

Imports of ours: errors.
"""

"""What every field of a specification is made of: unit, source, range, dotted path, findings.

Imports of ours: errors.
"""

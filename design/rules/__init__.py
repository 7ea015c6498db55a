"""Does it fit, can it be built, can it be judged? Each rule says field, value, limit and way out.

Imports of ours: circuit, geometry and below. `check` asks them all.
"""

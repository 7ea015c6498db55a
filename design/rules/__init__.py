"""Rules of fit, manufacture and judgement. Each finding has field, value, limit and way out.

Imports of ours: circuit, geometry and below. `check` applies all rules.
"""

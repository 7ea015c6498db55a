"""Rules that a design must obey to be manufactured and judged; each finding has field, value, limit and remedy.

The function `check.check` applies all rules. The package imports only `optopad.design.circuit`, `optopad.design.mold`
and packages below them.
"""

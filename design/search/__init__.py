"""Which designs to try next: the space, the study, the front. What is good is told from outside.

Imports of ours: spec, the files of `design/` itself.
"""

"""Search for better designs: the space, the study, the front. The caller provides the objective.

Imports of ours: spec, the files of `design/` itself.
"""

"""The verbs under `optopad driver`.

Imports of ours: the shared files of `optopad/cli`, and lazily everything else.
"""

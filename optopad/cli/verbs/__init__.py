"""The verbs of the command line, one file a group.

Imports of ours: the shared files of `optopad/cli`, and lazily everything else.
"""

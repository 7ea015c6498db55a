"""The sections of a page, one a file.

Imports of ours: scenes, text, optopad.work and the rooms below.
"""

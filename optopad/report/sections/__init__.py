"""The sections of a page, one per file.

Imports of ours: scenes, text, optopad.work and the rooms below.
"""

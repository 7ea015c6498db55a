"""The sections of a page, one a file.

Imports of ours: scenes, text and the rooms below.
"""

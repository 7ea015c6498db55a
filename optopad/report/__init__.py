"""The page of a bundle: one HTML file with everything at a glance, and its plots as files.

Rooms: scenes, sections, assets. Imports of ours: results, screen, work and the rooms below.
"""

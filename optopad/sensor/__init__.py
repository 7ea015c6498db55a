"""Jobs around the built sensor: its configuration, firmware, live views, presses by a stage.

Imports of ours: work and the rooms below.
"""

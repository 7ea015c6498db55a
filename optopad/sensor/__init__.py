"""Jobs around the built sensor: its configuration, firmware, live views, presses by a stage.

It may import design, sims and fabrication.
"""

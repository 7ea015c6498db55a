"""Output for the manufacture of a design: its folder of files, sheets, firmware, and the driver of a unit.

Subfolders: sheets, driver, stage, scene, firmware (in C). Imports within this repository: design, cad, sims.
"""

"""Output for the manufacture of a design: its folder of files, sheets, firmware, and the driver of a unit.

Rooms: sheets, driver, stage; firmware in C. Imports of ours: design, cad, sims.
"""

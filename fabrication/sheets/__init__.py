"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Imports within this repository: the files directly in `fabrication/`, design, optopad.sims.readings.
"""

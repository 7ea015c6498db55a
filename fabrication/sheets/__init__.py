"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Imports within this repository: the files of `fabrication/` itself, design, cad, sims.readings.
"""

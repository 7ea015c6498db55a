"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Imports of ours: the files of `fabrication/` itself, design, cad, sims.readings.
"""

"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Imported project modules: the files directly in `fabrication/`, design, cad, sims.readings.
"""

"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Project modules that it imports: the files directly in `fabrication/`, design, cad, sims.readings.
"""

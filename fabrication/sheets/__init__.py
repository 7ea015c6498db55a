"""Sheets for manufacturing: bill of materials, casting, wiring, schematic, gain.

Project imports: the files directly in `fabrication/`, design, cad, sims.readings.
"""

"""Printable parts of a design: CAD solids, volume formulas, checks and export as files."""

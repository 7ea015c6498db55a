"""Printable parts of a design: CAD solids, checks and export as files."""

"""Printable solids of a design: mold, checks, export."""

"""Design to printable solids: mold, checks, export."""

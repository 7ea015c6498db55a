"""The studio, where a design is edited live in a browser. The page is in `view`; all other modules work without it.

It may import design, sims, cad and fabrication, and `work`, `report`, `bundle_parts`, `screen` and `sensor` of
optopad. Only `view` may import viser.
"""

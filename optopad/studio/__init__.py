"""The studio: a design live in a browser. The model of it (design, edits, answers, work); the page is in `view`.

It may import design, sims, cad and fabrication, and `results`, `work`, `report`, `jobs`, `screen` and `sensor` of
optopad. Only `view` may import viser.
"""

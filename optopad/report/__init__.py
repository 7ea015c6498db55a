"""The page of a bundle: one HTML file with everything at a glance, and its plots as files.

It may import `screen` of optopad, and design, sims, cad and fabrication.
"""

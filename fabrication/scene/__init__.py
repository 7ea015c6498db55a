"""The pad in a robot's simulation: its MJCF, and its twin that gives the frames of its board.

Imports within this repository: design, cad, sims, the driver.
"""

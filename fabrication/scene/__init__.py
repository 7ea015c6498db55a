"""The pad in MuJoCo: its body with contact, mass and taxels, a demo scene, and the twin that gives the frames of its board.

Imports within this repository: design, cad, sims, the driver.
"""

"""The pad in MuJoCo: its body with contact, mass and taxels, a demo scene, and the twin that gives its board's frames.

Imports within this repository: design, cad, sims, the driver.
"""

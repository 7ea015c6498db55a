"""The pad in MuJoCo: its body with contact, mass and taxels, and a demo scene with a gripper.

Imports within this repository: design, cad, sims, fabrication.driver.
"""

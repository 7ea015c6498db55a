"""From design to unit: the bundle, and the driver configuration of sheets, firmware and driver.

Rooms: sheets, driver, stage; firmware in C. Imports of ours: design, cad, sims.
"""

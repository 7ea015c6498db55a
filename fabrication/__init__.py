"""Design to bench: the bundle, and the driver configuration that sheets, firmware and driver share.

Rooms: sheets, driver, stage; firmware in C. Imports of ours: design, cad, sims.
"""

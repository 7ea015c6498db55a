"""Design to bench: the bundle, and the driver configuration that sheets, firmware and driver share.

Rooms: sheets, firmware, driver, stage. Imports of ours: design, cad, sims.
"""

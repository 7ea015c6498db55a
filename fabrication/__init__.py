"""From design to unit: the bundle, and the driver configuration of sheets, firmware and driver.

Packages: sheets, driver, stage. The folder firmware has C sources. Imports within this repository: design, cad, sims.
"""

"""Design to bench: bill of materials, wiring, casting, driver configuration, bundle."""

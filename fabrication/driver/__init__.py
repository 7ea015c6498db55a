"""The built sensor at the bench: frames over a serial line. Runs without the CAD kernel and without the physics."""

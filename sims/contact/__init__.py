"""Contact: MuJoCo soft contact gives the deformed surface, force and contact radius."""

"""Design to signals: contact, light, continuity."""

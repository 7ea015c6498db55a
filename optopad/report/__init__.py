"""The page of a bundle: one HTML file with everything at a glance, and its plots as files."""

"""Style sheet, templates and scripts of a page."""

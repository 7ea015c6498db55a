"""Words, numbers and marks of a page.

Imports of ours: sims, design, screen.
"""

"""From a design to its signals and its verdict.

Rooms in the order of imports: contact, optics, readings, verdict, bounds, score; then learning, which uses some of
them, and plots, which shows all. They import design.
"""

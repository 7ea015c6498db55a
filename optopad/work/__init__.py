"""How long work is done: kept pieces, work on other threads and machines, figures as files.

Imports of ours: design, sims, fabrication.
"""

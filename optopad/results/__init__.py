"""What a job found, as plain data: accuracy, comparison, search.

Imports of ours: design, sims.
"""

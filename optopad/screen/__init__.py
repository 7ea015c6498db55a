"""What a job says in the terminal, in a few lines.

Imports of ours: report, jobs, the rooms below.
"""

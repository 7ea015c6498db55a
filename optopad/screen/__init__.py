"""What the terminal, a notebook and `--json` show: the results of verbs, the verdict's sentences, progress.

Imports within this repository: design, sims, fabrication, work.
"""

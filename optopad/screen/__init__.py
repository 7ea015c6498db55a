"""The sentences of a verdict: the lines in the terminal, and the sentences that the report shares with them.

Imports within this repository: design, sims, work.
"""

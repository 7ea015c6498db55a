"""The sentences of a verdict: the few lines of the terminal, and the words that the report shares with them.

Imports within this repository: design, sims, work.
"""

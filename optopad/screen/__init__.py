"""The sentences of a verdict: the few lines of the terminal, and the words that the report shares with them.

Imports of ours: design, sims, work.
"""

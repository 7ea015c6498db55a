"""What a verdict says in sentences: the few lines of the terminal, and the words that the report shares with them.

Imports of ours: design, sims, work.
"""

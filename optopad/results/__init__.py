"""Results of jobs: figures as plain data, with their text, plots and form in a notebook.

Imports within this repository: design, sims, screen. Only the plots import drawing libraries.
"""

"""Results of commands and of `import optopad`: figures as plain data, with text, plots and display in a notebook.

Imports within this repository: design, sims, fabrication, screen. Only the plots import drawing libraries.
"""

"""The front door for scripts and notebooks: a call a task, and results that hold figures, maps and plots.

Imports of ours: everything below, inside the calls alone, so that `import optopad` stays quick.
"""

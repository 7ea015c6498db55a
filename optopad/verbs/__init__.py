"""What optopad does, a file a verb: each function is called from Python, and is a command of the command line.

Imports within this repository: all but the command tree, which imports the verb that the user types.
"""

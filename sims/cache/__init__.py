"""What is kept on disk between runs: traced light, compiled kernels.

Imports of ours: design.errors.
"""

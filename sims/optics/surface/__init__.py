"""The pressed top: curves around each tip, their sum, the grid on it.

It imports scene and press.
"""

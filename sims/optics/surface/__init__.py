"""What the pressed top is: curves around each tip, their sum, the grid on it.

Imports of ours: scene, press.
"""

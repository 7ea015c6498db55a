"""The shape of a pad: its outline in plan and its top. The one room that knows the names of shapes.

Imports of ours: arrays.
"""

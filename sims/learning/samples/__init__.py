"""What learners are trained on: checked samples, splits by place, scalings, settings.

Imports of ours: inference, readings, press.
"""

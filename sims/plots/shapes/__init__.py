"""Shapes that pictures of a pad share: its outline, its workspace, its top under a press.

Imports of ours: contact, optics, press.
"""

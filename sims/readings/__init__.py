"""From light to counts and files: gains, signal chain, press protocols, data sets, recordings.

Imports of ours: optics, contact, press.
"""

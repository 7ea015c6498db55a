"""From light to counts and files: gains, signal chain, press protocols, data sets, recordings.

It imports optics, contact and press.
"""

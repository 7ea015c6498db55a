"""One learner a file: kernel ridge (the paper's), trees, network, the touch classifier.

Imports of ours: samples, inference, readings.
"""

"""One learner a file: kernel ridge (the paper's), trees, network, Gaussian process, the touch classifier.

Imports of ours: samples, inference, readings.
"""

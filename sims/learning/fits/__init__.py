"""One learner per file: kernel ridge (the paper's), trees, network, the touch classifier.

It imports samples, inference and readings.
"""

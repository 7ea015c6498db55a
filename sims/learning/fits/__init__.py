"""One learner per file: kernel ridge (the paper's), trees, the touch classifier.

It imports samples, inference and readings.
"""

"""The pad in a robot's simulation: what its pairs read of any object, in microseconds.

It imports learning, readings, optics, contact and held objects.
"""

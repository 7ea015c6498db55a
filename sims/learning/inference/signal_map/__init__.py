"""The signal map at run time: a spline of the signals, and the search for the press that explains a frame.

numpy and the standard library only.
"""

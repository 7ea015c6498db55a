"""Where everything is: the cavity that is printed and that light travels in, sockets, mold outline, letters.

Imports of ours: spec and below.
"""

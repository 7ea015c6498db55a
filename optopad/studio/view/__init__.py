"""The studio's page: a thin view of the session in a browser, by viser.

This is the only package that imports viser. It may import optopad.studio and the packages that optopad.studio imports.
"""

"""The studio's page: a thin view of the session in a browser, by viser.

The only folder that imports viser. May import optopad.studio and the rooms below.
"""

"""The studio: a design live in a browser. The model of it (design, edits, answers, work); the page is in `view`.

May import the rooms below, and of optopad results, work, report, jobs, screen and sensor; viser only in `view`.
"""

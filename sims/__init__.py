"""From a design to its signals and its verdict.

Its packages in the order of imports: contact, optics, readings, verdict, bounds, score. Then come learning, which uses
some of these, and plots, which draws the results of all. All import `design`.
"""

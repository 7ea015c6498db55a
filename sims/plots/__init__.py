"""Plots, one per module: each `plot_x(result, ax=None) -> Axes` has units on the axes and displays nothing."""

"""Plots, one a module: each `plot_x(result, ax=None) -> Axes`, units on the axes, nothing is displayed."""

"""Plots of a verdict: one plot a module, each `plot_x(result, ax=None) -> Axes`, units on the axes, no display."""

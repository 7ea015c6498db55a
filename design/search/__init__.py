"""Search for better designs: search space, study, Pareto front and recommended designs.

The caller provides the objective function. The package imports only `optopad.design.spec`, packages below it and
modules directly in `design`.
"""

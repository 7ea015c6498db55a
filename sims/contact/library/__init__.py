"""Library of solved presses, shipped and cached, with smooth interpolation between them.

It imports the contact solver, the wall model, and the modules `tip` and `scope` of `optopad.sims.contact`.
"""

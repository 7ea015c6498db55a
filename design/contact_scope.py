"""What the contact model covers, so that a design can be told before anything is solved.

Limits of the feasibility study (section "Contact"): outside them the solver was not compared with the
independent finite-element solution.
"""

LAYER_DEPTH_RANGE = (1.3, 6.0)
"""Elastic depths (clear + black layer) that are modelled [tip radii]."""
LARGEST_SHARE_OF_LAYER = 0.8
"""Deepest press as a share of the elastic depth [-]."""
DEEPEST_PRESS = 1.7
"""Deepest press [tip radii]."""

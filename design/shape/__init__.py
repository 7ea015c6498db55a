"""The shape of a pad: its outline and top, the optical parts around it, and the emitter-receiver pairs.

The modules `outline` and `top` do not depend on designs. The package imports only `optopad.design.spec` and packages
below it.
"""

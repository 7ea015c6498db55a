"""The fast light model: modules by kind of light, joined by `states`; `trace_states` is the entry point.

It imports scene, surface, cache and accuracy.
"""

"""The fast light model: one module per kind of light, joined by `states`. The entry point is `trace_states`.

It imports scene, surface, cache and accuracy.
"""

"""The fast light model: rooms by kind of light, `states` joins them, `trace_states` is the way in.

Imports of ours: scene, surface, cache, accuracy.
"""

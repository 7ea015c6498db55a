"""The plain ray tracer that the fast model is held against; no intersection or Fresnel code is shared.

Imports of ours: scene, press, cache.
"""

"""The plain ray tracer with which the fast model is compared; no intersection or Fresnel code is shared.

It imports scene, press and cache.
"""

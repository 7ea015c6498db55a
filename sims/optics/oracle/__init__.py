"""The plain ray tracer with which the fast model is compared. The two share no intersection or Fresnel code.

It imports scene, press and cache.
"""

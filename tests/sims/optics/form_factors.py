"""Closed-form factors between rectangles: what fraction of a Lambertian emitter's light reaches a receiver."""

import numpy as np


def parallel_factor(x, y, eta, xi, z):
    """Form factor between parallel rectangles x (2,), y (2,) and xi, eta, z apart (Howell C-13)."""
    total = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                for d in range(2):
                    u, v = x[a] - xi[c], y[b] - eta[d]
                    p, q = np.hypot(u, z), np.hypot(v, z)
                    g = v * p * np.arctan(v / p) + u * q * np.arctan(u / q)
                    g -= z * z / 2 * np.log(u * u + v * v + z * z)
                    total += (-1) ** (a + b + c + d) * g
    return total / (2 * np.pi * (x[1] - x[0]) * (y[1] - y[0]))


def perpendicular_factor(x, y, eta, xi):
    """Form factor between rectangles on two perpendicular planes that share the y axis (Howell C-15).

    Rectangle 1: x (2,) from the common edge, y (2,) along it; rectangle 2: xi (2,) from the edge, eta (2,).
    """
    total = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                for d in range(2):
                    k2 = x[a] ** 2 + xi[c] ** 2
                    k, v = np.sqrt(k2), y[b] - eta[d]
                    g = v * k * np.arctan(v / k) - (k2 - v * v) / 4 * np.log(k2 + v * v)
                    total += (-1) ** (a + b + c + d) * g
    return total / (2 * np.pi * (x[1] - x[0]) * (y[1] - y[0]))

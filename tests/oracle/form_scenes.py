"""Pads that are no flat rectangles, and analytic presses on crowns, that the oracle's tests share."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.top import Top
from optopad.sims.optics.scene.optical_scene import WHOLE_CIRCLE, OpticalScene, PadForm
from optopad.sims.press import Indentation

DISC_MM = 12.0
"""Radius of the round pads."""


def block(form: PadForm | None, size: tuple[float, float], **changes: Any) -> OpticalScene:
    """A pad, 8 mm high, with the parts that are given (`parts`)."""
    fields: dict[str, Any] = {
        "length_mm": size[0],
        "width_mm": size[1],
        "height_mm": 8.0,
        "refractive_index": 1.41,
        "absorption_per_mm": 0.0,
        "wall_reflectance": 0.05,
        "bottom_reflectance": 0.03,
        "tip_reflectance": 0.0,
        "form": form,
    }
    scene = OpticalScene(**(fields | changes))
    return scene if form is None else replace(scene, form=with_top(form, clear_mm=scene.height_mm))


def with_top(form: PadForm, **changes: Any) -> PadForm:
    """A form with another top."""
    return replace(form, top=replace(form.top, **changes))


def top_of(x_mm: float, y_mm: float, radius_mm: float = math.inf, axis: str = "none") -> Top:
    """A top, 8 mm high at x, y; straight along an axis, or a sphere."""
    bend = 1.0 / radius_mm
    return Top(
        clear_mm=8.0,
        apex_mm=(x_mm, y_mm),
        kx=0.0 if axis == "x" else bend,
        ky=0.0 if axis == "y" else bend,
    )


def parts(
    emitters: list[tuple[int, float, float, float, float]],
    receivers: list[tuple[int, float, float, float, float]],
) -> dict[str, Any]:
    """Fields of emitters and receivers from rows of wall, along, z, half width, half height."""
    return {
        "emitter_wall": np.array([row[0] for row in emitters], dtype=np.int64),
        "emitter_patch": np.array([row[1:] for row in emitters], dtype=np.float64).reshape(-1, 4),
        "emitter_order": np.ones(len(emitters)),
        "receiver_wall": np.array([row[0] for row in receivers], dtype=np.int64),
        "receiver_patch": np.array([row[1:] for row in receivers], dtype=np.float64).reshape(-1, 4),
    }


def disc_form(facets: int, crown_radius_mm: float = math.inf, half_mm: float = 1.5) -> PadForm:
    """A round pad of `DISC_MM` with facets at equal angles; along runs from 0 to twice the half width."""
    rows = []
    for k in range(facets):
        angle = 2.0 * math.pi * (k + 0.15) / facets
        nx, ny = math.cos(angle), math.sin(angle)
        away = math.sqrt(DISC_MM**2 - half_mm**2)
        x, y = DISC_MM + away * nx + half_mm * ny, DISC_MM + away * ny - half_mm * nx
        rows.append((x, y, -ny, nx, nx, ny))
    return PadForm(
        walls=np.array(rows, dtype=np.float64).reshape(-1, 6),
        arcs=np.array([(DISC_MM, DISC_MM, DISC_MM, *WHOLE_CIRCLE)]),
        top=top_of(DISC_MM, DISC_MM, crown_radius_mm),
    )


def disc_scene(facets: int = 8, crown_radius_mm: float = math.inf, **changes: Any) -> OpticalScene:
    """A round pad, 8 mm high at its middle, with emitters of 1 x 1 and receivers of 2.6 x 2.6 mm on facets in turn."""
    emitters = [(k, 1.5, 4.0, 0.5, 0.5) for k in range(0, facets, 2)]
    receivers = [(k, 1.5, 4.0, 1.3, 1.3) for k in range(1, facets, 2)]
    form = disc_form(facets, crown_radius_mm)
    return block(form, (2 * DISC_MM, 2 * DISC_MM), **(parts(emitters, receivers) | changes))


def rectangle_form(
    length_mm: float, width_mm: float, radius_mm: float = math.inf, axis: Any = "none"
) -> PadForm:
    """A rectangle as a form: south, east, north, west."""
    return PadForm(
        walls=np.array(
            [
                (0.0, 0.0, 1.0, 0.0, 0.0, -1.0),
                (length_mm, 0.0, 0.0, 1.0, 1.0, 0.0),
                (0.0, width_mm, 1.0, 0.0, 0.0, 1.0),
                (0.0, 0.0, 0.0, 1.0, -1.0, 0.0),
            ]
        ),
        arcs=np.empty((0, 6)),
        top=top_of(length_mm / 2, width_mm / 2, radius_mm, axis),
    )


def vault_scene(axis: str, **changes: Any) -> OpticalScene:
    """A rectangle of 24 x 20 mm, 8 mm high along its ridge, under a cylinder of radius 30 mm."""
    emitters = [(0, 7.0, 3.5, 0.5, 0.5), (1, 12.0, 3.5, 0.5, 0.5), (2, 16.0, 3.5, 0.5, 0.5)]
    receivers = [(3, 9.0, 3.5, 1.3, 1.3), (2, 8.0, 3.5, 1.3, 1.3), (1, 7.0, 3.5, 1.3, 1.3)]
    form = rectangle_form(24.0, 20.0, 30.0, axis)
    return block(form, (24.0, 20.0), **(parts(emitters, receivers) | changes))


def fall_mm(radius_mm: FloatArray | float, crown_mm: float) -> FloatArray:
    """How far a sphere lies below its tangent plane."""
    return np.asarray(crown_mm - np.sqrt(crown_mm**2 - np.asarray(radius_mm) ** 2))


def crown_press_shape(depth_mm: float, mean_mm: float) -> tuple[float, float, float]:
    """Contact radius of Hertz, displacement lost beyond it, and width of the skirt, under a 3 mm tip [mm]."""
    contact = math.sqrt(depth_mm * 3.0 * mean_mm / (3.0 + mean_mm))
    drop = depth_mm - float(fall_mm(contact, 3.0)) - float(fall_mm(contact, mean_mm))
    slope = contact / math.sqrt(9.0 - contact**2) + contact / math.sqrt(mean_mm**2 - contact**2)
    return contact, drop, 3.0 * drop / slope


def displacement_mm(
    radius_mm: FloatArray, depth_mm: float, mean_mm: float, bulge_mm: float = 0.0
) -> FloatArray:
    """Height above the untouched crown: tip less mean crown, then a cubic skirt that meets it smoothly."""
    contact, drop, reach = crown_press_shape(depth_mm, mean_mm)
    r = np.minimum(radius_mm, contact)
    inside = -depth_mm + fall_mm(r, 3.0) + fall_mm(r, mean_mm)
    x = np.clip((np.asarray(radius_mm) - contact) / reach, 0.0, 1.0)
    skirt = -drop * (1.0 - x) ** 3 + 16.0 * bulge_mm * x**2 * (1.0 - x) ** 2
    return np.where(radius_mm < contact, inside, skirt)


def crown_press(depth_mm: float, mean_mm: float, bulge_mm: float = 0.0) -> Indentation:
    """The analytic press on a crown of a mean radius."""
    contact, _, reach = crown_press_shape(depth_mm, mean_mm)
    radius = np.concatenate([np.linspace(0.0, contact, 100)[:-1], np.linspace(contact, contact + reach, 400)])
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=3.0,
        radius_mm=radius,
        height_mm=displacement_mm(radius, depth_mm, mean_mm, bulge_mm),
        contact_radius_mm=contact,
        force_n=1.0,
    )

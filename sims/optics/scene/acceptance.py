"""What counts of the light that arrives at a receiver from inside the elastomer, by its angle.

Model
-----
Elastomer of index n lies on the part's flat face, behind it epoxy of index n_e with the chip. Light at angle a
in the elastomer enters the epoxy at angle e, n sin a = n_e sin e (Snell), as the unpolarised Fresnel share
T(n -> n_e, a) = 1 - (R_s + R_p) / 2 (Hecht, Optics, eqs 4.34 to 4.62), and the chip counts the share q(e) of it:

    response(cos a) = T(n -> n_e, a) q(e),   q(0) = 1.

So normal incidence counts T(n -> n_e, 0), 0.998 for silicone against common epoxy, and a bare receiver, whose
part has no epoxy index, counts 1 at every angle. One common gain scales all signals; only ratios of angles matter.

The chip's own q comes from the sheet's angles in air, where the same face sees, relative to the axis,
S(b) = cos b T(1 -> n_e, b) / T(1 -> n_e, 0) q(e), sin b = n_e sin e:

* a table: q is S over the other two factors, at most 1 (a sheet that was rounded to the cosine gives a little more).
  It holds to the table's last angle or `FARTHEST_DEG`, whichever comes first; light further out, which in air the face
  cannot even let in, is assumed to count as at that angle.
* a half angle h: q = cos^p e with the p, 0 or more, that gives S(h) = 1/2. A half angle of 60 degrees or more is p = 0,
  a flat chip that counts all light alike.

As a table over the cosine, linear between 129 nodes, T is off by 1e-5 of diffuse light for epoxy denser than the
elastomer; for a thinner one the critical angle is rounded off within a cell, 1.6e-3 at most (scan of indices).

Left out: lenses (bedded in elastomer they lose their power; `check` warns), reflection at the chip, light lost at the
epoxy's side faces, polarisation.
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.parts.angular import AngularTable
from design.parts.catalog import Part
from sims.optics.scene.emission import COSINE_NODES, cosine_nodes

FARTHEST_DEG = 80.0
"""Towards grazing a sheet divides one small number by another; beyond 80 degrees a sheet says little."""


def transmitted_share(cosine: FloatArray, index_from: float, index_to: float) -> FloatArray:
    """Unpolarised Fresnel transmission of power at a flat interface.

    Parameters
    ----------
    cosine : (...,) cosine of the angle of incidence, 0 to 1 [-]
    index_from, index_to : of the medium that the light comes from, and goes to [-]

    Returns
    -------
    (...,) share of the power, 0 beyond the critical angle [-]
    """
    c = np.asarray(cosine, dtype=np.float64)
    if index_from == index_to:
        return np.ones_like(c)
    inner = refracted_cosine(c, index_from, index_to)
    c = np.where(inner > 0.0, c, 1.0)  # no light passes there; only keeps 0 / 0 out
    s = (index_from * c - index_to * inner) / (index_from * c + index_to * inner)
    p = (index_to * c - index_from * inner) / (index_to * c + index_from * inner)
    share = 1.0 - (s * s + p * p) / 2.0
    return np.asarray(np.where(inner > 0.0, share, 0.0))


def refracted_cosine(cosine: FloatArray, index_from: float, index_to: float) -> FloatArray:
    """(...,) cosine behind the interface by Snell's law; 0 at the critical angle and beyond [-]."""
    sine = index_from / index_to * np.sqrt(1.0 - np.asarray(cosine, dtype=np.float64) ** 2)
    return np.asarray(np.sqrt(np.clip(1.0 - sine * sine, 0.0, None)))


def response_nodes(part: Part, refractive_index: float, count: int = COSINE_NODES) -> FloatArray:
    """Response of a receiver at the cosine's nodes, for the scene.

    Parameters
    ----------
    part : the receiver
    refractive_index : of the elastomer [-]
    count : nodes

    Returns
    -------
    (count,) share of the arriving light that is counted, 0 to 1 [-]; all 1 for a bare receiver
    """
    if part.epoxy_index is None:
        return np.ones(count)
    cosine, epoxy = cosine_nodes(count), part.epoxy_index.value
    inner = refracted_cosine(cosine, refractive_index, epoxy)
    if part.angular_response is None:
        counted = inner ** half_angle_power(part.half_angle_deg.value, epoxy)
    else:
        counted = _counted_by_table(part.angular_response, inner, epoxy)
    return np.asarray(transmitted_share(cosine, refractive_index, epoxy) * counted)


def half_angle_power(half_angle_deg: float, epoxy_index: float) -> float:
    """The p, at least 0, of the chip's cos^p in epoxy whose response in air is half at an angle [-]."""
    outer = np.cos(np.radians(half_angle_deg))
    face = float(outer * _relative_entry(outer, epoxy_index))
    inner = float(refracted_cosine(outer, 1.0, epoxy_index))
    return max(0.0, float(np.log(0.5 / face) / np.log(inner)))


def _counted_by_table(table: AngularTable, inner: FloatArray, epoxy_index: float) -> FloatArray:
    """(n,) the chip's q at cosines in the epoxy, from a sheet's response in air."""
    sine = np.minimum(epoxy_index * np.sqrt(1.0 - inner * inner), 1.0)
    angle = np.minimum(np.degrees(np.arcsin(sine)), min(FARTHEST_DEG, table.last_deg))
    outer = np.cos(np.radians(angle))
    seen = table.at(angle) / table.relative[0]
    return np.minimum(seen / (outer * _relative_entry(outer, epoxy_index)), 1.0)


def _relative_entry(outer: FloatArray, epoxy_index: float) -> FloatArray:
    """(...,) transmission from air into the epoxy over that on the axis [-]."""
    on_axis = transmitted_share(np.ones(()), 1.0, epoxy_index)
    return np.asarray(transmitted_share(outer, 1.0, epoxy_index) / on_axis)

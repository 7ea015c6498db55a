"""How hard the tip pushes each node of the top: what the pressure under the tip is made of.

The solver finds one normal force a contact between the tip and an element of the layer. Each is shared
out to the two nodes of the top between which the contact lies, by the lever rule, so that the forces on
the nodes add up to the sum of all contacts. (The solver itself lets a contact act on all corners of its
element, 1 to 2 % of the load on nodes below the top; that detail of the mesh is left out here.)
"""

from __future__ import annotations

import mujoco
import numpy as np

from design.arrays import FloatArray


def contact_forces(data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
    """Frictionless contacts of the last step.

    Returns
    -------
    (contact, 2) radius and height of the contacts, (contact,) their normal forces, on this wedge alone
    """
    count = data.ncon
    address = np.asarray(data.contact.efc_address[:count], dtype=np.int64)
    kept = address >= 0
    place = np.asarray(data.contact.pos[:count], dtype=np.float64).reshape(-1, 3)[kept]
    at = np.stack([np.hypot(place[:, 0], place[:, 1]), place[:, 2]], axis=1)
    return at, np.asarray(data.efc_force, dtype=np.float64)[address[kept]]


def shared_out(at: FloatArray, force: FloatArray, nodes: FloatArray) -> FloatArray:
    """Point forces on the nodes of a polyline, each split between the ends of the segment nearest to it.

    Parameters
    ----------
    at : (force, 2) where the forces act
    force : (force,) their sizes
    nodes : (node, 2) the polyline

    Returns
    -------
    (node,) their sum is that of `force`
    """
    side = np.diff(nodes, axis=0)
    offset = at[:, None, :] - nodes[None, :-1, :]
    share = np.clip(np.einsum("fsk,sk->fs", offset, side) / np.einsum("sk,sk->s", side, side), 0.0, 1.0)
    distance = np.linalg.norm(offset - share[:, :, None] * side[None], axis=2)
    nearest = distance.argmin(axis=1)
    far = share[np.arange(len(force)), nearest]
    count = len(nodes)
    return np.asarray(
        np.bincount(nearest, weights=(1.0 - far) * force, minlength=count)
        + np.bincount(nearest + 1, weights=far * force, minlength=count),
        dtype=np.float64,
    )

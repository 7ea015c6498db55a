r"""Contact parameters of a pad in MuJoCo: a ball of the tip's radius meets the force of the contact model.

MuJoCo has no law of force and depth as such. With the notation of its documentation ("Computation", solver
parameters), a contact with penetration r and impedance d(r), at rest, presses with

    f = k d(r) r / R(r),    R = (1 - d) / d · Â,    k = 1 / (dmax² T²),    Â = w(pad) + w(object),

where T is the time constant (`solref`, at damping ratio 1), dmax the largest impedance (`solimp`), and w the inverse
weights of the bodies (`body_invweight0` [1/kg]). Â makes the force depend on the object's mass. `tuned` therefore
replaces the pad's inverse weight by one of 10,000 /kg and more, next to which an object's hardly counts: a ball of 5 g
has 200 /kg, one of 2 kg 0.5 /kg. The pad's contact is on a body of its own, so no other contact changes.

With so large a weight, 1 - d is of the order of 1e-4, and the law becomes r / f = Â (1 - d(r)) / k. `solimp` is nearly
exponential for large powers,

    1 - d(r) = e + (e₀ - e) exp(-r / λ),

whose three constants are fitted to r / f of the contact model, so that the largest relative error is least. The
exponent is `POWER`; its difference from an exponential is part of the fit. e is `LEAST_GAP`, since MuJoCo limits d to
0.9999; Â follows from it.

The parameters do not depend on the time step. The motion of an object follows MuJoCo's reference acceleration
-k d r - 2 v / T, or less where the object is heavy, so it is stable for every mass if T is at least two steps.
MuJoCo raises a smaller T, which would change the force; so `tuned` refuses steps above `LARGEST_STEP_S`.

With a pyramidal friction cone MuJoCo adds 2 (n - 1) edges (n is `condim`) of R = 2 µ² / impratio · (1 - d) / d ·
(1 + µ²) Â each. `tuned` multiplies the inverse weight by the quotient, so that the force is that of an elliptic cone.

Left out: the form of the object. Each contact point has the force of the tip's ball: a larger ball presses too lightly,
and a face, which MuJoCo presses with up to four points, has four times the force of a ball, whatever its size.
`stiffness` of `tuned` corrects the force of one kind of object; tests/validation/scene/objects_table.md has the forces.
The curve is that of a press in the middle of the pad: presses next to walls are up to a tenth stiffer. Viscosity, which
silicone has, is replaced by the damping that MuJoCo needs for its steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog, minimize_scalar

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.once import once
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of

if TYPE_CHECKING:
    import mujoco

LARGEST_STEP_S = 0.004
"""Largest time step for which the contact is fitted [s]."""
TIME_CONSTANT_S = 2.0 * LARGEST_STEP_S
"""Time constant T of the contact [s]; MuJoCo raises it to two steps if it is less."""
LEAST_GAP = 1.2e-4
"""1 - d of a deep press [-]; MuJoCo allows 1e-4 and more."""
POWER = 70.0
MIDPOINT = 1e-4
"""`power` of `solimp` [-], large so that the impedance is almost exponential, and its `midpoint`, the least."""
USUAL_WEIGHT = 100.0
"""Inverse weight of an object for which the force is that of the fit [1/kg]: between 5 g and a heavy object."""
LEAST_MM, DEEPEST_MM, LAYER_SHARE = 0.3, 3.0, 1.0 / 3.0
"""Range of depths of the fit [mm]; it ends at the third of the elastic layer where that is less."""
DEPTHS = 24
SPIN_DEPTH_MM = 1.0
"""Depth of the press whose contact radius gives the torsional friction [mm]; less if the fit ends above it."""
WEIGHT, TOP, DESIGN = "pad_inverse_weight", "pad_top", "pad_design"
"""Names in the pad's model: the number with its inverse weight, the geom that is pressed, the digest of the design."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactFit:
    """Contact parameters of a pad.

    Attributes
    ----------
    solref, solimp : parameters of the pressed geom, as MuJoCo names them; lengths in m, times in s
    inverse_weight : Â, the sum of inverse weights of pad and object [1/kg]
    depth_mm : (n,) depths of the fit [mm]
    force_n : (n,) force of a ball of the tip's radius, from the contact model [N]
    contact_radius_mm : radius of contact of this ball at `SPIN_DEPTH_MM` [mm]
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    inverse_weight: float
    depth_mm: FloatArray
    force_n: FloatArray
    contact_radius_mm: float

    def force_at_n(self, depth_mm: FloatArray) -> FloatArray:
        """Force (...) of a ball at rest at depths (...) [mm] in MuJoCo [N]; 0 without contact."""
        low, high, width, _, power = self.solimp
        depth_m = np.maximum(np.asarray(depth_mm, np.float64), 0.0) * 1e-3
        share = np.minimum(depth_m / width, 1.0)
        rise = np.where(
            share < MIDPOINT,
            share**power / MIDPOINT ** (power - 1.0),
            1.0 - (1.0 - share) ** power / (1.0 - MIDPOINT) ** (power - 1.0),
        )
        impedance = low + rise * (high - low)
        stiffness = 1.0 / (high * self.solref[0] * self.solref[1]) ** 2
        found = stiffness * impedance**2 * depth_m / ((1.0 - impedance) * self.inverse_weight)
        return np.asarray(found)

    @property
    def largest_step_s(self) -> float:
        """Largest time step for which the fit holds [s]."""
        return self.solref[0] / 2.0

    @property
    def error(self) -> FloatArray:
        """(n,) relative error of MuJoCo's force at the depths of the fit [-]."""
        return np.asarray(self.force_at_n(self.depth_mm) / self.force_n - 1.0)


@once
def contact_fit(design: SensorDesign) -> ContactFit:
    """Fit the contact parameters of a design's pad, for a ball of the tip's radius, whatever the tip's shape.

    Raises
    ------
    ModelScopeError : the contact model does not cover the pad.
    """
    contact = contact_of(design.with_ball())
    layer_mm = contact.layer * contact.tip_radius_mm
    deepest = min(DEEPEST_MM, LAYER_SHARE * layer_mm, contact.depth_limit_mm)
    press, depths = solved_press(contact, deepest), np.geomspace(LEAST_MM, deepest, DEPTHS)
    force = np.array([press.force_n(float(depth)) for depth in depths])
    softness = depths * 1e-3 / force  # r / f [m/N]

    def fall(length_mm: float) -> FloatArray:
        """Exponential part of 1 - d at the depths, 1 at first touch; its length λ [mm]."""
        return np.asarray((1.0 - depths / (POWER * length_mm)) ** POWER)

    def worst(length_mm: float) -> float:
        return _least_error(fall(length_mm) / softness, 1.0 / softness)[1]

    length = float(minimize_scalar(worst, bounds=(0.1 * deepest, deepest), method="bounded").x)
    (steep, last), _ = _least_error(fall(length) / softness, 1.0 / softness)
    first_gap = LEAST_GAP * (1.0 + steep / last * (1.0 - MIDPOINT) ** (POWER - 1.0))
    high = 1.0 - LEAST_GAP
    return ContactFit(
        solref=(TIME_CONSTANT_S, 1.0),
        solimp=(round(1.0 - first_gap, 6), high, round(POWER * length * 1e-3, 6), MIDPOINT, POWER),
        inverse_weight=float(f"{last / (high * TIME_CONSTANT_S) ** 2 / LEAST_GAP:.6g}"),
        depth_mm=depths,
        force_n=force,
        contact_radius_mm=press.at(min(SPIN_DEPTH_MM, deepest)).contact_radius_mm,
    )


def _least_error(*shapes: FloatArray) -> tuple[tuple[float, ...], float]:
    """Factors of shapes (n,), at least 0, whose sum is nearest to 1 in the largest error, and that error."""
    table = np.stack(shapes, axis=1)
    ones = np.ones((len(table), 1))
    found = linprog(
        [*np.zeros(len(shapes)), 1.0],
        A_ub=np.block([[table, -ones], [-table, -ones]]),
        b_ub=np.concatenate([ones, -ones]).ravel(),
    ).x
    return tuple(float(one) for one in found[:-1]), float(found[-1])


def tuned(model: mujoco.MjModel, name: str = "", *, stiffness: float = 1.0) -> int:
    """Set the inverse weight of a pad in a compiled model, so that forces follow the contact model.

    To be called once after the model is compiled, and again after `mj_setConst`, which computes inverse weights anew.

    Parameters
    ----------
    name : the pad's name, which was given as prefix ``name_`` when it was attached; "" without prefix
    stiffness : factor of all forces, for objects that are unlike a ball of the tip's radius [-]

    Returns
    -------
    Number of the geom that is pressed.

    Raises
    ------
    InputError : the model has no such pad, its time step is too long for the fit, or the factor is out of range.
    """
    import mujoco

    geom = pad_geom(model, name)
    if not 0.01 <= stiffness <= 100.0:
        raise InputError(f"stiffness: {stiffness:g} is refused; give a factor of the force from 0.01 to 100")
    step = float(model.opt.timestep)
    if step > LARGEST_STEP_S * (1.0 + 1e-9):
        raise InputError(
            f"timestep: {step * 1e3:g} ms, but the pad's contact is fitted for at most {LARGEST_STEP_S * 1e3:g} ms; "
            f"set model.opt.timestep to {LARGEST_STEP_S:g} or less"
        )
    body = int(model.geom_bodyid[geom])
    if int(model.body_geomnum[body]) != 1:
        raise InputError(
            f"{prefixed(name, TOP)}: its body has {int(model.body_geomnum[body])} geoms, but the pad's contact needs a "
            "body of its own; leave fusestatic out of the model's compiler options"
        )
    weight = float(model.numeric(prefixed(name, WEIGHT)).data[0]) - USUAL_WEIGHT
    dimensions, friction = int(model.geom_condim[geom]), float(model.geom_friction[geom, 0])
    if model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL and dimensions > 1:
        weight *= (dimensions - 1) * model.opt.impratio / (friction**2 * (1.0 + friction**2))
    model.body_invweight0[body] = weight / stiffness
    return geom


def prefixed(name: str, element: str) -> str:
    """Name of a pad's element in a model: ``left_pad_top`` for the pad ``left``."""
    return f"{name}_{element}" if name else element


def pad_geom(model: mujoco.MjModel, name: str) -> int:
    """Number of the geom that is pressed.

    Raises
    ------
    InputError : the model has no such pad; the message names the pads that it has.
    """
    import mujoco

    for kind, element in ((mujoco.mjtObj.mjOBJ_GEOM, TOP), (mujoco.mjtObj.mjOBJ_NUMERIC, WEIGHT)):
        if mujoco.mj_name2id(model, kind, prefixed(name, element)) < 0:
            tops = [model.geom(k).name for k in range(model.ngeom)]
            pads = [repr(one.removesuffix(TOP).removesuffix("_")) for one in tops if one.endswith(TOP)]
            raise InputError(
                f"name: {name!r} is no pad of this model, which has no {prefixed(name, element)!r}; its pads are "
                f"{', '.join(pads) or 'none'}; attach one with the prefix {prefixed(name, '')!r}: "
                "optopad.fabrication.scene.mjcf.pad_spec, or the file pad.xml of `optopad scene`"
            )
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, prefixed(name, TOP)))

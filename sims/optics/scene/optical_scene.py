"""The optical scene as plain typed arrays: what every kernel and the oracle sees, and nothing more.

Frame: x from 0 to the inner length, y from 0 to the inner width, z = 0 at the bottom of the clear
layer and z = clear thickness at the undisturbed top. Walls are numbered south (y = 0) 0, east
(x = length) 1, north (y = width) 2, west (x = 0) 3. A patch on a wall is a rectangle given by its
centre along the wall (x for south and north, y for east and west), its centre height, and two
half sizes. The part of a patch above the top is not in the scene: only the submerged part emits
or receives, and an emitter's flux is a fraction of the power that its *whole* area would emit.

Angles at a patch are tables over the cosine c to its inward normal, at nodes `np.linspace(0, 1, n)`,
linear between them (`sims.optics.scene.emission` makes and weighs them).
"""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import FloatArray, IntArray
from sims.optics.scene.pad_form import PadForm


@dataclass(frozen=True, kw_only=True)
class OpticalScene:
    """A block of clear elastomer with flat emitters and receivers on its walls.

    Attributes
    ----------
    length_mm, width_mm, height_mm : size of the clear block along x, y, z [mm]
    refractive_index : of the elastomer against air [-]
    absorption_per_mm : natural-log absorption coefficient [1/mm]
    wall_reflectance, bottom_reflectance, tip_reflectance : diffuse (Lambertian) reflectance [-]
    emitter_wall : (e,) wall number; receiver_wall : (r,) likewise
    emitter_patch : (e, 4) rows of along, z, half width along the wall, half height [mm], as mounted
    receiver_patch : (r, 4) likewise
    emitter_order : (e,) Lambertian order m of the intensity cos^m [-]; 1 is a Lambertian source
    emitter_pattern : (e, n) radiance over power and area L(c) [1/sr] at the cosine's nodes: the intensity of
        the whole area's unit power is c L(c), so that 2 pi int c L dc = 1. A row of NaN: this emitter by
        its order. None: all by their order, L(c) = (m + 1) / (2 pi) c^(m - 1)
    receiver_response : (r, n) share of the light which arrives from inside the elastomer at cosine c that
        is counted, 0 to 1 [-]. None: 1 at every angle
    wall_index : index of the material behind smooth walls [-]; 1 is an air gap. At a wall outside the receivers'
        faces (emitters' faces count as wall) the unpolarised Fresnel share from `refractive_index` to it, 1 beyond
        the critical angle, is mirrored; of the rest `wall_reflectance` is scattered, the remainder absorbed.
        None: walls only scatter. The bottom never mirrors
    form : walls and top of a pad that is no block; None: the block of the frame above. With a
        form `height_mm` is the height at the apex; `length_mm` and `width_mm` are those of the box around the plan,
        which begins at 0, 0; wall numbers are rows of `form.walls`, and a patch's along is measured there. The
        part of a patch above the untouched top at its own place is not in the scene
    """

    length_mm: float
    width_mm: float
    height_mm: float
    refractive_index: float
    absorption_per_mm: float
    wall_reflectance: float
    bottom_reflectance: float
    tip_reflectance: float
    emitter_wall: IntArray
    emitter_patch: FloatArray
    emitter_order: FloatArray
    receiver_wall: IntArray
    receiver_patch: FloatArray
    emitter_pattern: FloatArray | None = None
    receiver_response: FloatArray | None = None
    wall_index: float | None = None
    form: PadForm | None = None

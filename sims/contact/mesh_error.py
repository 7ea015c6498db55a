"""How far the default mesh is from better solutions, as measured. These figures enter no result.

Case: tip radius 3 mm, elastic depth 8 mm, modulus 1 MPa, wall bonded at 16 mm; spacing under the tip
0.31 mm (the default, a tenth of the tip radius), MuJoCo 4.0.0. Two comparisons:

* force against the check values of the feasibility study, an independent axisymmetric Q2/Q1
  displacement-pressure finite-element solution with Poisson's ratio 0.499;
* surface outside the contact, out to 9 mm from the axis, and force against this solver's own 0.18 mm mesh
  (with half the contact stiffness: the stiffer one chatters on it beyond 4.7 mm).

The second tells the mesh apart from the rest: with the 0.18 mm mesh force is still +2.0, +1.0, +0.7, +1.0,
+1.3, +1.5, +2.5 % above the study's. Contact radii are 0.81, 1.27, 1.81, 2.47, 2.85, 2.99, 3.00 mm on the
default mesh and 0.80, 1.28, 1.81, 2.48, 2.84, 2.99, 3.00 mm on the fine one, up to 0.08 mm above the study's
0.76, 1.26, 1.77, 2.40, 2.82, 3.00, 3.00 mm, whose way of finding the edge is not recorded. The surface
overlaps the tip by 2 to 35 um at 0.2 to 5 mm. Other layers and depths were not compared.
"""

from __future__ import annotations

from design.spec import SensorDesign

CASE_TIP_RADIUS_MM = 3.0
"""Tip radius of the measured case [mm]."""
CHECK_DEPTH_MM = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0)
"""Depths compared [mm]."""
CHECK_FORCE_N = (0.303, 1.261, 3.758, 11.06, 19.89, 28.58, 36.46)
"""The study's force [N]."""
DEFAULT_FORCE_ERROR = (0.047, 0.036, 0.018, 0.017, 0.021, 0.030, 0.058)
"""Force of the default mesh over the study's, less 1 [-]."""
FORCE_AGAINST_FINE = (0.027, 0.026, 0.011, 0.007, 0.008, 0.015, 0.033)
"""Force of the default mesh over that of the 0.18 mm mesh, less 1 [-]."""
SURFACE_RMS_UM = (0.6, 1.8, 2.0, 3.6, 6.0, 11.3, 23.7)
"""Distance of the default mesh's curve from the 0.18 mm mesh's, root mean square [um]."""
SURFACE_LARGEST_UM = (1.7, 4.5, 4.6, 6.5, 10.3, 18.0, 39.1)
"""The same, largest [um]."""


def mesh_note(design: SensorDesign) -> str:
    """The measured error of the default contact mesh down to the design's deepest press, in one sentence."""
    scale = design.indenter.tip_radius_mm / CASE_TIP_RADIUS_MM
    depths = [depth * scale for depth in CHECK_DEPTH_MM]
    deepest = design.operating.max_depth_mm
    reached = min(sum(depth < deepest - 1e-9 for depth in depths) + 1, len(depths))
    force = 100.0 * max(DEFAULT_FORCE_ERROR[:reached])
    surface = scale * max(SURFACE_LARGEST_UM[:reached])
    return (
        f"contact mesh error: force up to +{force:.1f} % (against an independent finite-element solution), "
        f"surface up to {surface:.0f} um (against a finer mesh), measured for an elastic depth of 8/3 tip radii"
    )

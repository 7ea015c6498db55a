"""What `optopad scene` says: the pad as MuJoCo has it, how well its force fits, and how to attach it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.spec import SensorDesign
from optopad.screen.answer import Result, labelled

if TYPE_CHECKING:
    from optopad.fabrication.scene.contact_fit import ContactFit


@dataclass(frozen=True, kw_only=True, repr=False)
class SceneView(Result):
    """A pad as a MuJoCo model.

    Attributes
    ----------
    design : the pad's design
    fit : its contact parameters
    mass_kg : its mass
    taxels : number of points of the tactile sensor
    light_errors : root mean square error of the map of light by kind of object, as a share of the untouched signal [-];
        None if the design has no map yet
    command : the command that makes the map of light
    files : files that were written
    """

    design: SensorDesign
    fit: ContactFit
    mass_kg: float
    taxels: int
    light_errors: dict[str, float] | None
    command: str
    files: tuple[Path, ...]

    @property
    def force_error(self) -> float:
        """Largest relative error of the force of a ball of the tip's radius, against the contact model [-]."""
        return float(np.abs(self.fit.error).max())

    def to_json(self) -> dict[str, Any]:
        """The result as plain data for JSON."""
        return {
            "design": {"name": self.design.name, "digest": self.design.digest},
            "mass_kg": self.mass_kg,
            "taxels": self.taxels,
            "contact": {
                "solref": list(self.fit.solref),
                "solimp": list(self.fit.solimp),
                "inverse_weight_per_kg": self.fit.inverse_weight,
                "force_error": self.force_error,
                "depth_mm": [float(one) for one in self.fit.depth_mm[[0, -1]]],
                "largest_step_s": self.fit.largest_step_s,
            },
            "light_errors": self.light_errors,
            "files": [str(file) for file in self.files],
        }

    def lines(self) -> list[str]:
        """The lines of the screen."""
        low, high = self.fit.depth_mm[[0, -1]]
        attach = "robot.attach(mujoco.MjSpec.from_file('pad.xml'), prefix='left_', site=finger_site)"
        return [
            labelled(
                "pad",
                f"{self.mass_kg * 1e3:.1f} g, {self.taxels} taxels; collision, meshes and sites in pad.xml",
            ),
            labelled(
                "contact",
                f"force of a {self.design.indenter.tip_radius_mm:g} mm ball within {self.force_error:.1%} of the "
                f"contact model from {low:g} to {high:g} mm, at steps up to {self.fit.largest_step_s * 1e3:g} ms",
            ),
            labelled("light", self._light),
            labelled("attach", attach),
            labelled("frames", "optopad.SimulatedPad(model, design, name='left').frame(data)"),
            labelled("demo", "demo.xml: two pads on a gripper pick a cylinder, a box and a ball"),
            labelled("files", str(self.files[0].parent)),
        ]

    @property
    def _light(self) -> str:
        if self.light_errors is None:
            return f"frames need a map of light, which {self.command} makes once, in 20 minutes on 2 cores"
        each = ", ".join(f"{kind} {100 * error:.2g} %" for kind, error in self.light_errors.items())
        return f"error of the map of light, rms over the untouched signal: {each}"

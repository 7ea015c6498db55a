"""Computes the signals of chosen presses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.progress import OnStep
from optopad.design.shape.cavity import CavityGeometry, cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import require_depth
from optopad.sims.optics.light_signals import LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import save_dataset, signals_dataset


def simulated(
    design: SensorDesign,
    presses: list[tuple[float, float, float]],
    folder: Path,
    *,
    seed: int,
    on_step: OnStep,
) -> dict[str, Any]:
    """Compute the signals of presses and write ``presses.nc`` into ``folder``; returns a summary.

    Parameters
    ----------
    presses : rows of x, y, depth [mm]; empty for default depths at the workspace's centre
    """
    cavity = cavity_of(design)
    states = np.array(presses) if presses else _default_presses(design, cavity)
    require_presses(design, states)
    deepest_mm = max(design.operating.max_depth_mm, float(states[:, 2].max()))  # the trace needs this depth
    solved_press(design, max_depth_mm=deepest_mm, on_step=lambda s: on_step("contact", s))
    light = trace(design, states, seed=seed, on_step=lambda done, total: on_step("light", done / total))
    save_dataset(signals_dataset(light, cavity), folder / "presses.nc")
    return {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "states": [_state_summary(light, number) for number in range(len(states))],
    }


def require_presses(design: SensorDesign, states: FloatArray) -> None:
    """Raise an error for presses outside the workspace, above the surface, or deeper than the contact model covers.

    states : (press, 3) x, y, depth [mm]
    """
    space = cavity_of(design).workspace
    for x_mm, y_mm, depth_mm in states:
        if depth_mm < 0.0:
            raise InputError(
                f"--press: depth {depth_mm:g} mm is refused: depth is measured from the untouched surface "
                "down; give 0 or more"
            )
        require_depth(design, float(depth_mm), "--press")
        if not space.contains(float(x_mm), float(y_mm)):
            raise ModelScopeError(
                f"--press: ({x_mm:g}, {y_mm:g}) mm is outside the workspace, {space.words}; press inside, or lower "
                "operating.workspace_margin_mm"
            )


def _default_presses(design: SensorDesign, cavity: CavityGeometry) -> FloatArray:
    space = cavity.workspace
    x_mm, y_mm = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
    depths = depth_schedule_mm(design.operating.max_depth_mm)
    return np.array([[x_mm, y_mm, float(depth)] for depth in depths])


def _state_summary(light: LightSignals, state: int) -> dict[str, Any]:
    return {
        "press_mm": light.presses[state].tolist(),
        "mean_flux": float(light.flux[state].mean()),
        "mean_flux_by_class": {name: float(flux[state].mean()) for name, flux in light.by_class.items()},
        "largest_standard_error": float(light.standard_error[state].max()),
        "flux": light.flux[state].tolist(),
    }

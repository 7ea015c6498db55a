"""Computes the signals of chosen presses, on request also by the plain ray tracer for comparison."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.progress import OnStep
from optopad.design.shape.cavity import CavityGeometry, cavity_of, direct_path_pairs
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import require_depth
from optopad.sims.optics.light_signals import LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import save_dataset, signals_dataset

ORACLE_DEPTHS_MM = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0)
"""Depths of the default presses if the ray tracer is used [mm]; few, because it needs seconds per press."""


def simulated(
    design: SensorDesign,
    presses: list[tuple[float, float, float]],
    folder: Path,
    *,
    oracle_rays: int | None,
    seed: int,
    on_step: OnStep,
) -> dict[str, Any]:
    """Compute the signals of presses and write ``presses.nc`` into ``folder``; returns a summary.

    If the ray tracer is used, its signals are written as ``oracle.nc``.

    Parameters
    ----------
    presses : rows of x, y, depth [mm]; empty for default depths at the workspace's centre
    oracle_rays : number of the ray tracer's rays per emitter and press; if None, the ray tracer is not used
    """
    cavity = cavity_of(design)
    states = np.array(presses) if presses else _default_presses(design, cavity, oracle_rays is not None)
    require_presses(design, states)
    deepest_mm = max(design.operating.max_depth_mm, float(states[:, 2].max()))  # the trace needs this depth
    solved_press(design, max_depth_mm=deepest_mm, on_step=lambda s: on_step("contact", s))
    light = trace(design, states, seed=seed, on_step=lambda done, total: on_step("light", done / total))
    save_dataset(signals_dataset(light, cavity), folder / "presses.nc")
    comparison = None
    if oracle_rays is not None:
        truth = _oracle(design, states, oracle_rays, seed, on_step)
        save_dataset(signals_dataset(truth, cavity), folder / "oracle.nc")
        comparison = _compared(light, truth, cavity, oracle_rays)
    return {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "states": [_state_summary(light, number) for number in range(len(states))],
        "oracle": comparison,
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


def _default_presses(design: SensorDesign, cavity: CavityGeometry, few: bool) -> FloatArray:
    space = cavity.workspace
    x_mm, y_mm = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
    deepest = design.operating.max_depth_mm
    depths = [d for d in ORACLE_DEPTHS_MM if d <= deepest] if few else depth_schedule_mm(deepest)
    return np.array([[x_mm, y_mm, float(depth)] for depth in depths])


def _oracle(design: SensorDesign, states: FloatArray, rays: int, seed: int, on_step: OnStep) -> LightSignals:
    from optopad.sims.optics.oracle.tracer import CLASSES, trace_oracle
    from optopad.sims.optics.scene.lower import scene_of
    from optopad.sims.optics.tracing import pressed_tops

    tops = pressed_tops(design, states, by_symmetry=False)
    found = trace_oracle(
        scene_of(design),
        states[:, :2],
        tops.near,
        fields=tops.fields,
        rays=rays,
        seed=seed,
        on_step=lambda done, total: on_step("oracle", done / total),
    )
    return LightSignals(
        flux=found.total,
        by_class=dict(zip(CLASSES, found.flux, strict=True)),
        standard_error=found.standard_error,
        presses=states,
        digest=design.digest,
        seed=seed,
    )


def _compared(light: LightSignals, truth: LightSignals, cavity: CavityGeometry, rays: int) -> dict[str, Any]:
    """Differences between fast model and ray tracer, in standard errors, for pairs with a straight path of light.

    Light that crosses the air in the dent is left out, because only the ray tracer follows such light.
    """
    mask = direct_path_pairs(cavity)
    inside = truth.flux - truth.by_class["crossing"]
    spread = np.hypot(light.standard_error, truth.standard_error)[:, mask]
    z = (light.flux - inside)[:, mask] / np.where(spread > 0, spread, np.inf)
    return {
        "rays": rays,
        "compared": int(z.size),
        "chi_square": float((z**2).sum()),
        "largest_z": float(np.abs(z).max()),
        "mean_ratio": float(light.flux[:, mask].sum() / inside[:, mask].sum()),
    }


def _state_summary(light: LightSignals, state: int) -> dict[str, Any]:
    return {
        "press_mm": light.presses[state].tolist(),
        "mean_flux": float(light.flux[state].mean()),
        "mean_flux_by_class": {name: float(flux[state].mean()) for name, flux in light.by_class.items()},
        "largest_standard_error": float(light.standard_error[state].max()),
        "flux": light.flux[state].tolist(),
    }

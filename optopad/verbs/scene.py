"""Writes the pad as a MuJoCo model, and makes its fast map of light."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from optopad.cli.verb import Asked, verb
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.scene import SceneView
from optopad.work import OUT


@verb()
def scene(
    design: SensorDesign,
    *,
    fit: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    asked: Asked,
    on_step: OnStep,
) -> SceneView:
    """Write the pad as a MuJoCo model, to attach to a robot's, and a demo scene.

    Parameters
    ----------
    fit : Also make the fast map of light that simulated frames need, once per design: 20 minutes on 2 cores.
    """
    from optopad.fabrication.scene.contact_fit import contact_fit
    from optopad.fabrication.scene.files import write_scene
    from optopad.fabrication.scene.mjcf import pad_spec, taxels_mm
    from optopad.sims.robot.fast_light import light_file, load_fast_light
    from optopad.sims.robot.light_fit import fit_fast_light

    require_valid(design)
    on_step("scene", 0.0)
    with bundle(design, out, seed=seed) as folder:
        names = list(write_scene(design, folder / "scene"))
    on_step("scene", 1.0)
    light = None
    if fit:
        light = fit_fast_light(design, seed=seed, on_step=on_step)
    elif (file := light_file(design)).is_file():
        with suppress(InputError):  # a damaged map counts as none here
            light = load_fast_light(file)
    return SceneView(
        design=design,
        fit=contact_fit(design),
        mass_kg=float(pad_spec(design).compile().body_mass.sum()),
        taxels=len(taxels_mm(design)),
        light_errors=None if light is None else light.errors,
        command=f"optopad scene {asked.words} --fit",
        files=tuple(out / bundle_name(design) / "scene" / name for name in names),
    )

"""The section on the paths of light: a rotatable view of the pad, a picture for print, and the numbers.

The page's script draws mold, bodies of the parts, pad, tip and light from data that are stored in the page.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from markupsafe import Markup

from optopad.design.shape.cavity import beside_chord
from optopad.report.scenes.ray_scene import RayScene, scene_json
from optopad.report.sections.drawings import Drawing, drawn
from optopad.report.words import part
from optopad.sims.plots.ray_sheet import ray_sheet
from optopad.sims.plots.rays import Cut, cut_of_pair, percent
from optopad.sims.plots.style import plain_style
from optopad.sims.rays import LOST

THIN = 2
"""The printed picture shows every n-th path, with this n, to keep the files small."""


def rays_section(
    scene: RayScene | str | None, mold: dict[str, Any] | None = None, sheet: Drawing | None = None
) -> Markup:
    """The section with view, controls, printed picture, table and data; or the reason why there is no view.

    Parameters
    ----------
    mold : result of `optopad.report.scenes.mold_scene`; if None, the pad is shown without a mold
    sheet : result of `sheet_of`; if None, it is drawn now
    """
    if scene is None:
        return Markup()
    if isinstance(scene, str):
        return part("rays", refusal=scene)
    kinds = [kind for kind in scene.kinds if kind is not LOST]
    shares = [[scene.share(number, kind) for kind in kinds] for number in range(len(scene.labels))]
    return part(
        "rays",
        refusal="",
        scene=scene,
        mold=mold,
        lost=LOST,
        sheet=sheet or sheet_of(scene),
        cut=_cut(scene),
        kinds=kinds,
        shares=[
            (label, [*row, sum(share or 0.0 for share in row)])
            for label, row in zip(scene.labels, shares, strict=True)
        ],
        percent=percent,
        scene_data=scene_json(scene),
    )


def _cut(scene: RayScene) -> Cut:
    """The cross-section through the pair nearest to the presses."""
    nearest = min(scene.pairs, key=lambda pair: beside_chord(scene.cavity, pair, scene.place_mm)[0])
    return cut_of_pair(scene.cavity, nearest)


def sheet_of(scene: RayScene) -> Drawing:
    """Cross-section and plan of the pad, untouched and under the middle press, for print and pages without scripts."""
    chosen = [scene.states[number] for number in sorted({0, len(scene.states) // 2})]
    states = [replace(one, paths=one.paths[::THIN], lost=one.lost[::THIN]) for one in chosen]
    title = f"{scene.design.name}: light of {', '.join(scene.pair_names)}"
    with plain_style():
        sheet = ray_sheet(states, scene.design, _cut(scene), title=title, caption="", is_of_untouched=True)
        return drawn("rays", sheet.axes[0], "Sections and plans of the pad with sample paths of light")

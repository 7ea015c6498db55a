"""The section on the paths of light: a rotatable view of the pad, a picture for print, and the numbers.

The page's script draws mold, bodies of the parts, pad, tip and light from data that are stored in the page.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from optopad.design.shape.cavity import beside_chord
from optopad.report.scenes.ray_scene import RayScene, scene_json
from optopad.report.sections.drawings import drawn, figure_of
from optopad.report.words import Html, data_element, element, radios, section, table
from optopad.sims.plots.ray_sheet import ray_sheet
from optopad.sims.plots.rays import cut_of_pair, percent
from optopad.sims.plots.style import plain_style
from optopad.sims.rays import LOST, LightKind

TITLE = "The sensor and its light in three dimensions"
THIN = 2
"""The printed picture shows every n-th path, with this n, to keep the files small."""
BUTTONS = (
    ("left", "\N{ANTICLOCKWISE OPEN CIRCLE ARROW}", "Rotate left"),
    ("right", "\N{CLOCKWISE OPEN CIRCLE ARROW}", "Rotate right"),
    ("up", "\N{UPWARDS ARROW}", "See more from above"),
    ("down", "\N{DOWNWARDS ARROW}", "See more from the side"),
    ("in", "+", "Larger"),
    ("out", "\N{MINUS SIGN}", "Smaller"),
    ("side", "side", "From the side"),
    ("plan", "plan", "From above"),
    ("reset", "reset", "Back to the first view"),
)
CAPTION = (
    "Lines are random sample paths of the ray tracer, drawn with a probability proportional to their "
    "power; of each pair, strong kinds have more lines, but weak ones are overrepresented. Dotted: rays "
    "that arrived while the pad was untouched, followed under the press to their ends (crosses). "
    "Percentages are from the light model, not from counts of lines."
)


def rays_section(scene: RayScene | str | None, mold: dict[str, Any] | None = None) -> Html:
    """The section with view, controls, printed picture, table and data; or the reason why there is no view.

    Parameters
    ----------
    mold : result of `optopad.report.scenes.mold_scene`; if None, the pad is shown without a mold
    """
    if scene is None:
        return Html("")
    if isinstance(scene, str):
        return section("rays", TITLE, element("p", scene))
    return section(
        "rays",
        TITLE,
        element("p", _lead(scene)),
        _view(scene, mold),
        element("div", _sheet(scene), id="rays-still"),
        element("p", CAPTION, class_="note"),
        _table(scene),
        data_element("rays-data", scene_json(scene)),
        *([] if mold is None else [data_element("mold-data", mold)]),
    )


def _lead(scene: RayScene) -> str:
    x_mm, y_mm = scene.place_mm
    where = "the middle of the middle facing pair" if scene.is_middle else "the location of least margin"
    along = "" if scene.cavity.plan.top.is_flat else ", along the normal of the top there"
    count = len(scene.pairs)
    which = (
        "of the facing pairs" if scene.is_middle else f"of the {count} judged pairs that pass nearest to it"
    )
    return (
        f"The pad under presses at {where}, x = {x_mm:g}, y = {y_mm:g} mm{along}, and the light {which}: "
        "direct (mode 2), mirrored by the top (mode 1), scattered, and light lost under the press."
    )


def _view(scene: RayScene, mold: dict[str, Any] | None) -> Html:
    name = "The sensor in three dimensions. Arrow keys rotate it, plus and minus change its size, 0 resets the view."
    return element(
        "div",
        element(
            "div",
            element(
                "fieldset", element("legend", "Press"), *radios("rays-press", scene.labels), class_="choices"
            ),
            *([] if mold is None else [_molds(mold)]),
            class_="rows",
        ),
        element("canvas", tabindex="0", role="img", aria_label=name, aria_describedby="rays-total"),
        element(
            "div",
            *(
                element("button", sign, type="button", data_do=do, title=words, aria_label=words)
                for do, sign, words in BUTTONS
            ),
            element("span", "drag or use the arrow keys", class_="note"),
            class_="turns",
        ),
        element(
            "fieldset", element("legend", "Light"), _pairs(scene), *map(_kind, scene.kinds), class_="choices"
        ),
        element("p", "", id="rays-total", data_total="", aria_live="polite"),
        id="rays-view",
        hidden="",
    )


def _molds(mold: dict[str, Any]) -> Html:
    looks = [("cut", "cut open", ""), ("whole", "whole", None)]
    if mold["lid"] is not None:
        looks.append(("lid", "with its lid, cut open", None))
    choices = (
        element(
            "label",
            element("input", type="radio", name="rays-mold", value=value, checked=checked),
            f" {words}",
        )
        for value, words, checked in (*looks, ("none", "hidden", None))
    )
    return element("fieldset", element("legend", "Mold"), *choices, class_="choices")


def _pairs(scene: RayScene) -> Html:
    names = ["all pairs shown", *scene.pair_names]
    options = (element("option", name, value=str(number)) for number, name in enumerate(names))
    return element("label", "of ", element("select", *options, name="rays-pair"))


def _kind(kind: LightKind) -> Html:
    box = element("input", type="checkbox", name="rays-kind", value=kind.key, checked="")
    share = element("span", "", data_share=kind.key, class_="number")
    return element("label", box, " ", _swatch(kind), f" {_title(kind)} ", share)


def _swatch(kind: LightKind) -> Html:
    line = "dotted" if kind is LOST else "dashed" if kind.dash else "solid"
    look = f"--day:{kind.colour};--night:{kind.night_colour};border-top-style:{line}"
    return element("span", class_="swatch", style=look, aria_hidden="true")


def _title(kind: LightKind) -> str:
    return "lost under the press" if kind is LOST else kind.title


def _sheet(scene: RayScene) -> Html:
    """Cross-section and plan of the pad, untouched and under the middle press, for print and pages without scripts."""
    cut = cut_of_pair(
        scene.cavity, min(scene.pairs, key=lambda pair: beside_chord(scene.cavity, pair, scene.place_mm)[0])
    )
    chosen = [scene.states[number] for number in sorted({0, len(scene.states) // 2})]
    states = [replace(one, paths=one.paths[::THIN], lost=one.lost[::THIN]) for one in chosen]
    title = f"{scene.design.name}: light of {', '.join(scene.pair_names)}"
    with plain_style():
        sheet = ray_sheet(states, scene.design, cut, title=title, caption="", is_of_untouched=True)
        drawing = drawn("rays", sheet.axes[0], "Sections and plans of the pad with sample paths of light")
    return figure_of(
        drawing,
        f"Section {cut.name} and plan, untouched and pressed. Tip and top are drawn where the section cuts them, paths "
        "as seen from the side.",
    )


def _table(scene: RayScene) -> Html:
    kinds = [kind for kind in scene.kinds if kind is not LOST]
    rows = [
        (label, *(_share(scene.share(number, kind)) for kind in kinds), _share(_total(scene, number, kinds)))
        for number, label in enumerate(scene.labels)
    ]
    heads = ("press", *(kind.title for kind in kinds), "together")
    return table(
        heads,
        rows,
        label="Light that arrives, of the untouched light",
        numeric=range(1, len(heads)),
        class_="rays",
    )


def _total(scene: RayScene, number: int, kinds: list[LightKind]) -> float:
    return sum(scene.share(number, kind) or 0.0 for kind in kinds)


def _share(share: float | None) -> str:
    return "not given" if share is None else percent(share)

"""The packaged designs (presets): two pads from one publication, two published discs, and six of optopad's own."""

from __future__ import annotations

import difflib
import re
import tomllib
from importlib.resources import files
from typing import TYPE_CHECKING

from optopad.design.errors import InputError

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign

FLAT_PRESETS = ("piacenza2017-pad", "piacenza2017-pair", "oblong-60x40", "fingertip-16")
"""Rectangular pads with a flat top."""
SHAPED_PRESETS = ("levi2013-disc", "crowned-40x25", "fingertip-dome", "gripper-stadium")
"""Disc, stadium and crowned pads."""
BOARD_PRESETS = ("gripper-teensy", "roboy-lightskin")
"""A rectangle and a disc that do not have the usual electronics (one input per receiver, which is read once)."""
FLOOR_PRESETS = ("disco-patch", "board-pad")
"""Pads whose parts stand on a circuit board below them, under a skin."""
WALL_PRESETS = FLAT_PRESETS + SHAPED_PRESETS + BOARD_PRESETS
"""Pads whose parts look out of the walls."""
PRESETS = WALL_PRESETS + FLOOR_PRESETS


def preset_text(name: str) -> str:
    """Text of a preset's TOML file with its comments.

    Raises
    ------
    InputError : no preset has this name; the message names a similar one.
    """
    if name not in PRESETS:
        near = difflib.get_close_matches(name, PRESETS, n=1)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"--preset: {name!r} is no preset{hint} There are: {', '.join(PRESETS)}")
    return (files("optopad.design.presets") / f"{name}.toml").read_text(encoding="utf-8")


def preset(name: str) -> SensorDesign:
    """Load a preset as a design; InputError if no preset has this name."""
    from optopad.design.spec import SensorDesign

    return SensorDesign.from_document(tomllib.loads(preset_text(name)), where=name)


def new_text(name: str, preset_name: str) -> str:
    """Text of a new design file based on a preset, without the comment and the description of the preset itself.

    Raises
    ------
    InputError : no preset has the name `preset_name`.
    """
    text = re.sub(r"\A#.*", f"# This design is based on the preset {preset_name}.", preset_text(preset_name))
    text = re.sub(r"(?m)^description = .*\n", "", text, count=1)
    return re.sub(r'(?m)^name = ".*"$', lambda _: f'name = "{name}"', text, count=1)


def true_description(design: SensorDesign) -> str:
    """Description of a design; empty if it is a preset's description but the design differs from that preset."""
    for name in PRESETS:
        packaged = preset(name)
        if design.description == packaged.description and design != packaged.with_(name=design.name):
            return ""
    return design.description

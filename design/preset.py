"""The packaged designs: the paper's pad and pair, a published disc, and four of our own."""

from __future__ import annotations

import difflib
import re
import tomllib
from importlib.resources import files

from design.errors import InputError
from design.spec import SensorDesign

FLAT_PRESETS = ("piacenza2017-pad", "piacenza2017-pair", "oblong-60x40", "fingertip-16")
"""Flat rectangles."""
SHAPED_PRESETS = ("levi2013-disc", "crowned-40x25", "fingertip-dome")
"""Discs and crowned pads."""
PRESETS = FLAT_PRESETS + SHAPED_PRESETS


def preset_text(name: str) -> str:
    """The commented TOML text of a preset.

    Raises
    ------
    InputError : no such preset; the nearest name is offered.
    """
    if name not in PRESETS:
        near = difflib.get_close_matches(name, PRESETS, n=1)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"--preset: {name!r} is no preset{hint} There are: {', '.join(PRESETS)}")
    return (files("design.presets") / f"{name}.toml").read_text(encoding="utf-8")


def preset(name: str) -> SensorDesign:
    """A preset as a design."""
    return SensorDesign.from_document(tomllib.loads(preset_text(name)), where=name)


def renamed_text(text: str, name: str) -> str:
    """A preset's text with another design name; comments stay."""
    return re.sub(r'(?m)^name = ".*"$', lambda _: f'name = "{name}"', text, count=1)

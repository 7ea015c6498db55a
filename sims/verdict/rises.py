"""Light that rises under a press: pairs that read more than untouched, how much, and by which light.

A press can only take straight light away. What rises is mirrored: beside the tip the press tilts the top, which then
mirrors more of an emitter into a receiver than the untouched top. Under a dome most of a pair's light is mirrored. Its
reading rises first, and falls when the tip takes the mirror away.

Left out: pairs that are nearly dark untouched, of which any light is a large share.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from sims.optics.light_signals import LightSignals

Part = Literal["smooth top", "flank of the dimple", "other light"]
LEAST_RISE = 0.05
"""A smaller share of the untouched light is not named [-]: 5 % are 15 noise units at a relative noise of 0.3 %."""
ERRORS = 2.0
"""Nor is one within so many standard errors of the light."""
DARK = 0.05
"""A pair with less than this share of the median pair's untouched light is dark [-]."""


@dataclass(frozen=True, kw_only=True)
class Rise:
    """The pair whose light rises most over its untouched light.

    Attributes
    ----------
    pair : its name, as E1-R3; share : its light over its untouched light [-]
    place_mm : (x, y), depth_mm : of that press [mm]
    part : the light that grows most
    pairs, judged : how many pairs rise at some press of the map, of how many that are not dark
    """

    pair: str
    share: float
    place_mm: tuple[float, float]
    depth_mm: float
    part: Part
    pairs: int
    judged: int

    @property
    def sentence(self) -> str:
        """In words."""
        x_mm, y_mm = self.place_mm
        why = (
            "the press tilts the top towards the receiver, and it mirrors more"
            if self.part != "other light"
            else "other than mirrored light grows"
        )
        return (
            f"{self.pairs} of {self.judged} pairs read more than untouched under some press; most {self.pair}, "
            f"{self.share:.0%} of its untouched light at x = {x_mm:g}, y = {y_mm:g} mm, {self.depth_mm:g} mm deep: "
            f"{why} ({self.part})"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "pair": self.pair,
            "share": round(self.share, 4),
            "place_mm": [round(value, 4) for value in self.place_mm],
            "depth_mm": round(self.depth_mm, 4),
            "part": self.part,
            "pairs": self.pairs,
            "judged": self.judged,
            "sentence": self.sentence,
        }


def rise_of(light: LightSignals, pairs: Mapping[str, tuple[int, int]]) -> Rise | None:
    """The largest rise of a map's light; None where no pair rises.

    Parameters
    ----------
    light : of single presses, the untouched pad among them
    pairs : emitter and receiver by name
    """
    untouched = light.presses[:, 2] <= 0.0
    if not pairs or not untouched.any():
        return None
    first = int(np.argmax(untouched))
    emitters, receivers = np.array(list(pairs.values())).T
    flux, error = (of[:, emitters, receivers] for of in (light.flux, light.error_of_changes))
    flat = flux[first]
    bright = flat > DARK * np.median(flat)
    per = 1.0 / np.where(bright, flat, 1.0)
    share = flux * per
    rises = bright & (share > 1.0 + LEAST_RISE) & (share - 1.0 > ERRORS * error * per)
    if not rises.any():
        return None
    state, column = (int(k) for k in np.unravel_index(np.argmax(np.where(rises, share, 0.0)), share.shape))
    at = (emitters[column], receivers[column])
    grown = {name: float(of[(state, *at)] - of[(first, *at)]) for name, of in light.by_class.items()}
    named: dict[str, Part] = {"top": "smooth top", "skirt": "flank of the dimple"}
    x_mm, y_mm, depth_mm = (float(value) for value in light.presses[state])
    return Rise(
        pair=list(pairs)[column],
        share=float(share[state, column]),
        place_mm=(x_mm, y_mm),
        depth_mm=depth_mm,
        part=named.get(max(grown, key=lambda name: grown[name]), "other light"),
        pairs=int(rises.any(axis=0).sum()),
        judged=int(bright.sum()),
    )

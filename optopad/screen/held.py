"""A press by objects, for the terminal and for JSON: force, contact, and the pairs that change."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.fields.packaged import data_quantities
from optopad.design.fields.quantity import Quantity
from optopad.design.shape.cavity import pair_name
from optopad.screen.answer import Result, labelled
from optopad.sims.contact.force_curve import band_factors
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.held import AskedPress, HeldLight
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

SHOWN_PAIRS = 3


@dataclass(frozen=True, kw_only=True, repr=False)
class HeldView(Result):
    """A press by objects: contact and signals.

    Attributes
    ----------
    draft : the design
    asked : the press as requested
    press : its contact
    light : its light
    young : Young's modulus of the elastomer [MPa]
    files : files that were written
    """

    draft: Draft
    asked: AskedPress
    press: HeldPress
    light: HeldLight
    young: Quantity
    files: tuple[Path, ...] = ()

    @property
    def words(self) -> str:
        """What presses, where and how deep."""
        x, y = self.asked.at_mm
        if len(self.asked.held) == 1:
            return f"{self.asked.held[0].words}, {self.press.depth_mm:.3g} mm deep at {x:g}, {y:g} mm"
        places = [(x if one.x is None else one.x, y if one.y is None else one.y) for one in self.asked.held]
        each = [
            f"{one.words}, at {a:g}, {b:g} mm" for one, (a, b) in zip(self.asked.held, places, strict=True)
        ]
        return f"{'; '.join(each)}; the deepest {self.press.depth_mm:.3g} mm"

    @property
    def _sideways(self) -> str:
        """How far and with which force the objects moved sideways, and what the contact does."""
        press = self.press
        x, y = (round(one, 3) + 0.0 for one in press.shear_mm)
        pull, slips = float(np.hypot(*press.pull_n)), press.slip_share
        does = "all of the contact slips" if slips > 0.995 else f"{100.0 * slips:.0f} % of the contact slips"
        return f"{x:.3g}, {y:.3g} mm by {pull:.3g} N{self._band(pull)}; {does}"

    @property
    def _friction(self) -> str:
        """How much pull the pad holds, and the friction it rests on."""
        band = data_quantities("friction.toml")["dry"]
        known = any(one.friction is not None for one in self.asked.held)
        assumed = "" if known else f" (assumed; dry silicone has {band.low:g} to {band.high:g})"
        return (
            f"{self.asked.friction:g}{assumed}; with the raised pad in front of the objects, it holds up to "
            f"{self.press.holds_n:.3g} N"
        )

    def _band(self, force_n: float) -> str:
        low, high = band_factors(self.young)
        return (
            "" if low == high else f" ({low * force_n:.3g} to {high * force_n:.3g} N over the modulus's band)"
        )

    @cached_property
    def changes(self) -> FloatArray:
        """(emitter, receiver) change of each reading [noise units]."""
        return np.asarray(self.light.changes[0])

    @property
    def ratios(self) -> FloatArray:
        """(emitter, receiver) light over untouched light [-]."""
        whole = np.where(self.light.untouched > 0.0, self.light.untouched, np.inf)
        return np.asarray(np.where(self.light.untouched > 0.0, self.light.flux[0] / whole, 1.0))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes about the objects and the contact."""
        return tuple(
            dict.fromkeys((*(note for one in self.asked.held for note in one.notes), *self.press.notes))
        )

    def lines(self) -> list[str]:
        """The press, the most important first."""
        press = self.press
        changed = np.abs(self.changes) >= DEADBAND_THRESHOLD
        highest = 1000.0 * float(press.top.height_mm.max())
        lines = [
            labelled("press", self.words),
            labelled("load", f"{press.force_n:.3g} N{self._band(press.force_n)}"),
            labelled(
                "contact",
                f"{press.area_mm2:.3g} mm2; largest pressure {press.pressure_mpa.max():.2g} MPa; the top rises by up "
                f"to {highest:.0f} um next to it",
            ),
            *(
                [labelled("sideways", self._sideways), labelled("friction", self._friction)]
                if self.asked.is_sideways
                else []
            ),
            labelled(
                "signals",
                f"{int(changed.sum())} of {changed.size} pairs change by {DEADBAND_THRESHOLD:g} sigma or more; all "
                f"together {np.linalg.norm(self.changes):.0f} sigma",
            ),
        ]
        order = np.argsort(-np.abs(self.changes), axis=None)[:SHOWN_PAIRS]
        for k, number in enumerate(order):
            e, r = (int(one) for one in np.unravel_index(number, changed.shape))
            if changed[e, r]:
                name = pair_name(self.draft.cavity, (e, r))
                words = f"{name}: {100.0 * (self.ratios[e, r] - 1.0):+.1f} %, {self.changes[e, r]:+.0f} sigma"
                lines.append(labelled("most" if k == 0 else "", words))
        return lines + [labelled("note", note) for note in self.notes]

    def screen(self) -> list[str]:
        """The press, and its pictures."""
        return [
            *self.lines(),
            *([labelled("files", f"{self.files[0].with_suffix('')}.*")] if self.files else []),
        ]

    def to_json(self) -> dict[str, Any]:
        """The press as plain data for JSON."""
        press, light, design = self.press, self.light, self.draft.design
        low, high = band_factors(self.young)
        cavity = self.draft.cavity
        return {
            "name": design.name,
            "digest": design.digest,
            "objects": [one.model_dump(mode="json", exclude_none=True) for one in self.asked.held],
            "at_mm": list(self.asked.at_mm),
            "depth_mm": press.depth_mm,
            "force_n": press.force_n,
            "force_band_n": None if low == high else [low * press.force_n, high * press.force_n],
            "area_mm2": press.area_mm2,
            "shear_mm": list(press.shear_mm),
            "pull_n": list(press.pull_n),
            "slip_share": press.slip_share,
            "friction": self.asked.friction if self.asked.is_sideways else None,
            "largest_pressure_mpa": float(press.pressure_mpa.max()),
            "largest_rise_mm": float(press.top.height_mm.max()),
            "emitters": [part.name for part in cavity.emitters],
            "receivers": [part.name for part in cavity.receivers],
            "untouched_counts": light.readout.counts(light.untouched).tolist(),
            "counts": light.readout.counts(light.flux[0]).tolist(),
            "ratio": self.ratios.tolist(),
            "change_sigma": self.changes.tolist(),
            "ratio_error": (
                light.error[0] / np.where(light.untouched > 0.0, light.untouched, np.inf)
            ).tolist(),
            "notes": list(self.notes),
            "files": [str(file) for file in self.files],
        }


def object_lines(found: dict[str, Any]) -> list[str]:
    """How a pad distinguishes objects, from the data of `ObjectScore.to_json`; the most important first."""
    if "refused" in found:
        return [labelled("objects", f"not computed: {found['refused']}")]
    names, count = list(found["objects"]), len(found["places_mm"])
    sentences = object_sentences(found)
    return [
        labelled(
            "objects",
            f"{', '.join(names[:-1])} and {names[-1]}, of the tip's size, at {found['force_n']:.2g} N each and {count} "
            "locations",
        ),
        *(labelled(label, sentence) for label, sentence in sentences),
    ]


def object_sentences(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Sentences about how a pad distinguishes objects, each with its label."""
    apart = np.array(found["apart_sigma"]).min(axis=0)
    names = list(found["objects"])
    pairs = sorted((float(apart[a, b]), names[a], names[b]) for a in range(len(names)) for b in range(a))
    alike = [
        f"{one} and {other} ({sigma:.1f} sigma)" for sigma, one, other in pairs if sigma < DEADBAND_THRESHOLD
    ]
    more = f" and {len(alike) - SHOWN_PAIRS} more" if len(alike) > SHOWN_PAIRS else ""
    sigma, one, other = pairs[0]
    distinct = (
        f"{len(pairs) - len(alike)} of {len(pairs)} pairs, location, depth and turn unknown; not "
        f"{', '.join(alike[:SHOWN_PAIRS])}{more}, less than {DEADBAND_THRESHOLD:g} sigma"
        if alike
        else f"all, location, depth and turn unknown; the closest, {one} and {other}, by {sigma:.0f} sigma"
    )
    reported = []
    for name in ("edge", "cylinder"):
        as_ball = found["as_ball"][name]
        away = f"{max(as_ball['moved_mm']):.1f} mm{' or more' if any(as_ball['is_beyond']) else ''} away"
        reported.append(
            f"{'an' if name == 'edge' else 'a'} {name} up to {away} and {_deeper(as_ball['deeper_mm'])}"
        )
    return [
        ("distinct", distinct),
        ("an edge", _known("its turn", found["edge_turn_deg"], "deg")),
        (
            "a cylinder",
            _known(f"its radius of {found['radius_of_tip_mm']:g} mm", found["cylinder_radius_mm"], "mm"),
        ),
        ("as a ball", f"a map of the ball reports {' and '.join(reported)}"),
    ]


def _deeper(values: list[float]) -> str:
    """Differences of depth in words [mm]."""
    low, high = (f"{value:+.1f}" for value in (min(values), max(values)))
    return f"{low} mm deeper" if low == high else f"{low} to {high} mm deeper"


def _known(what: str, values: list[float | None], unit: str) -> str:
    """How well one frame gives a value, in words; None is not resolved at a location."""
    known = [one for one in values if one is not None]
    if not known:
        return f"one frame does not give {what}"
    words = f"{min(known):.2g}" if len(known) == 1 else f"{min(known):.2g} to {max(known):.2g}"
    lost = len(values) - len(known)
    return f"one frame gives {what} within {words} {unit}" + (
        f", but not at {lost} of {len(values)} locations" if lost else ""
    )

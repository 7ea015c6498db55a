"""How far flat presses, and presses between solved curvatures, are from a crowned one.

    python -m tests.validation.contact.crown.crown_growth

prints two tables, which `crown_growth.md` holds too; seconds, from `crown_reference.npz` and the shipped library. All
pads are those of `SERIES`: 9 mm thick at the apex, 22 mm wide, a tip of 3 mm, κ its radius over the crown's. Every
guess is a surface above the untouched crown and a force; it is put on the crown and compared with the oracle outside
the contact, to 9 mm from the axis.

* same tip: the flat pad of the same thickness, pressed as deep by the same tip (the oracle's).
* smaller tip: the flat pad of the same thickness under a tip of a Rc/(a + Rc), whose curvature is the relative one of
  tip and crown (the oracle's). Exact at first touch (Hertz).
* library: the same from the shipped library, whose own error on flat pads is in it.
* linear, parabola, cubic: ln force and the places of the top's nodes, above the crown, as polynomials in κ through the
  oracle's pads of 0 and 0.25, of 0.15 too, and of 0.05 too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.press import Indentation
from tests.validation.contact.contact_comparison import PressError, press_error
from tests.validation.contact.contact_reference import contact_edge, sampled_curve
from tests.validation.contact.contact_table import markdown_table
from tests.validation.contact.crown.crown_oracle import Crown
from tests.validation.contact.crown.crown_reference import (
    ALIKE,
    DEPTHS,
    LAYER,
    SERIES,
    TIP_MM,
    Pad,
    crown_state,
)

FRAGMENT = Path(__file__).with_name("crown_growth.md")
FLAT = SERIES[0]
POLYNOMIALS = {"linear": (0.0, 0.25), "parabola": (0.0, 0.15, 0.25), "cubic": (0.0, 0.05, 0.15, 0.25)}
"""Curvatures between which a guess is interpolated."""


@dataclass(frozen=True, kw_only=True)
class Guess:
    """A press above the untouched crown; lengths in tip radii, force in E R².

    Attributes
    ----------
    radius, height : (n,) the top from the axis to the wall
    force, contact_radius : of the press
    """

    radius: FloatArray
    height: FloatArray
    force: float
    contact_radius: float


def same_tip(_: Pad, depth: float) -> Guess:
    """The flat pad under the same tip."""
    state = crown_state(FLAT, depth)
    radius, height = state.curve()
    return Guess(radius=radius, height=height, force=state.force, contact_radius=state.contact_radius)


def smaller_tip(pad: Pad, depth: float) -> Guess:
    """The flat pad under a tip of the relative curvature."""
    [alike] = [one for one in ALIKE if np.isclose(one.tip, 1.0 / (1.0 + pad.curvature))]
    state, tip = crown_state(alike, depth), alike.tip
    radius, height = state.curve()
    return Guess(
        radius=tip * radius,
        height=tip * height,
        force=tip**2 * state.force,
        contact_radius=tip * state.contact_radius,
    )


def library(pad: Pad, depth: float) -> Guess:
    """What the shipped library has for that tip."""
    tip = 1.0 / (1.0 + pad.curvature)
    press = shipped_library().press(LAYER / tip, pad.wall / tip)
    curve = press.curve_at(depth / tip)
    return Guess(
        radius=tip * curve.radius,
        height=tip * curve.height,
        force=tip**2 * press.force_at(depth / tip),
        contact_radius=tip * curve.contact_radius,
    )


def weights(nodes: Sequence[float], curvature: float) -> FloatArray:
    """(node,) Lagrange's weights of values at curvatures for the one asked for [-]."""
    return np.array(
        [
            np.prod([(curvature - other) / (node - other) for other in nodes if other != node])
            for node in nodes
        ]
    )


def between(nodes: Sequence[float]) -> Callable[[Pad, float], Guess]:
    """The polynomial in κ through solved curvatures."""
    pads = [next(pad for pad in SERIES if np.isclose(pad.curvature, node)) for node in nodes]

    def guess(pad: Pad, depth: float) -> Guess:
        share = weights(nodes, pad.curvature)
        places = np.zeros_like(crown_state(pads[0], depth).nodes)
        for weight, solved in zip(share, pads, strict=True):
            here = crown_state(solved, depth).nodes.copy()
            here[:, 1] += Crown(solved.curvature).drop(here[:, 0])
            places += weight * here
        force = np.exp(share @ [np.log(crown_state(solved, depth).force) for solved in pads])
        radius, height = sampled_curve(places, 16)
        below = places[:, 1] - Crown(pad.curvature).drop(places[:, 0])
        edge = contact_edge(np.stack([places[:, 0], below], axis=1), depth)[0]
        return Guess(radius=radius, height=height, force=float(force), contact_radius=edge)

    return guess


GUESSES: dict[str, Callable[[Pad, float], Guess]] = {
    "same tip": same_tip,
    "smaller tip": smaller_tip,
    "library": library,
    **{name: between(nodes) for name, nodes in POLYNOMIALS.items()},
}


def error(guess: Guess, pad: Pad, depth: float) -> PressError:
    """A guess against the oracle's crowned press."""
    below = guess.height - Crown(pad.curvature).drop(np.minimum(guess.radius, pad.wall))
    press = Indentation(
        depth_mm=depth * TIP_MM,
        tip_radius_mm=TIP_MM,
        radius_mm=guess.radius * TIP_MM,
        height_mm=below * TIP_MM,
        contact_radius_mm=guess.contact_radius * TIP_MM,
        force_n=guess.force * TIP_MM**2,
    )
    return press_error(press, crown_state(pad, depth), 1.0)


def _cells(pad: Pad, depth: float, show: Callable[[PressError], str]) -> list[str]:
    """κ, depth and the figure of every guess; nothing where a polynomial passes through the pad."""
    cells = [f"{pad.curvature:.3g}", f"{depth * TIP_MM:g}"]
    for name, guess in GUESSES.items():
        is_node = any(np.isclose(pad.curvature, node) for node in POLYNOMIALS.get(name, ()))
        cells.append("" if is_node else show(error(guess(pad, depth), pad, depth)))
    return cells


def markdown() -> str:
    """Both tables."""
    head = ["κ", "depth mm", *GUESSES]
    presses = [(pad, depth) for pad in SERIES[1:] for depth in DEPTHS]
    force = [_cells(*press, lambda one: f"{100.0 * (one.force_ratio - 1.0):+.1f}") for press in presses]
    surface = [_cells(*press, lambda one: f"{one.surface_rms_um:.1f}") for press in presses]
    return "\n\n".join(
        [
            "Force, per cent off:",
            markdown_table(head, force),
            "Surface outside the contact, µm rms off:",
            markdown_table(head, surface),
        ]
    )


if __name__ == "__main__":
    text = markdown()
    FRAGMENT.write_text(text + "\n", encoding="utf-8")
    print(text)

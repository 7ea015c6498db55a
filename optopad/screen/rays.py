"""Light paths in a pad under presses, for the terminal, for JSON, and as the words of their picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.shape.cavity import CavityGeometry, cavity_of
from optopad.design.spec import SensorDesign
from optopad.screen.answer import Result
from optopad.sims.optics.paths import LightPath
from optopad.sims.plots.rays import Cut
from optopad.sims.rays import KINDS, LOST, RayState, kind_of


@dataclass(frozen=True, kw_only=True, repr=False)
class RayView(Result):
    """Content of a picture of light paths.

    Attributes
    ----------
    name : name of the requested light, for file names: E2-R5, E2, R5 or all
    cut : line in plan along which the pad is cut for the pictures
    states : paths and powers without contact, then under each press
    is_aimed : whether a single receiver is requested. Powers then refer to the receiver's untouched light, otherwise to
        the emitted light
    presses_are : description of why these presses were chosen
    files : files that were written
    """

    design: SensorDesign
    name: str
    cut: Cut
    states: tuple[RayState, ...]
    is_aimed: bool
    presses_are: str
    seed: int
    files: tuple[Path, ...] = ()

    @property
    def unit(self) -> float:
        """Reference power of the shown fractions, as a fraction of the emitted power [-]."""
        return self.states[0].total if self.is_aimed and self.states[0].total > 0.0 else 1.0

    def lines(self) -> list[str]:
        """Text with the light of every press by kind of path (mode 1, mode 2, ...), one line per press."""
        of = "of the untouched light" if self.is_aimed else "of the emitted light"
        lines = [f"light     {self.name}, powers in % {of}; presses {self.presses_are}"]
        for state in self.states:
            x_mm, y_mm, depth_mm = state.press_mm
            where = (
                f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm" if depth_mm > 0.0 else "untouched"
            )
            shares = state.power_by_kind
            kinds = [kind for kind in KINDS if kind.key in shares]
            words = "  ".join(f"{kind.key} {100 * shares[kind.key] / self.unit:.2f}" for kind in kinds)
            lines.append(f"{where:<39} total {100 * state.total / self.unit:6.2f}  {words}")
        return lines

    def to_json(self) -> dict[str, Any]:
        """Powers of the light under each press by kind of path, for JSON; without the paths."""
        return self._powers() | {"files": [str(file) for file in self.files]}

    def screen(self) -> list[str]:
        """The powers, and the files."""
        return [*self.lines(), *(f"file      {file}" for file in self.files)]

    def _powers(self) -> dict[str, Any]:
        return {
            "name": self.design.name,
            "digest": self.design.digest,
            "seed": self.seed,
            "light": self.name,
            "presses_are": self.presses_are,
            "power_of": "untouched light" if self.is_aimed else "emitted light",
            "unit_flux": self.unit,
            "states": [_state_json(state, self.unit) for state in self.states],
        }

    def paths_json(self) -> dict[str, Any]:
        """Content of a picture of light paths for JSON: powers, legend, and the points of every path."""
        document = self._powers()
        cavity = cavity_of(self.design)
        for row, state in zip(document["states"], self.states, strict=True):
            row["paths"] = [_path_json(path, cavity) for path in state.paths]
            row["lost_paths"] = [
                _path_json(path, cavity) | {"kind": LOST.key, "arrived_at": _receiver_name(cavity, former)}
                for path, former in zip(state.lost, state.lost_by, strict=True)
            ]
        kinds = [
            {"kind": kind.key, "title": kind.title, "mode": kind.mode, "classes": list(kind.classes)}
            for kind in KINDS
        ]
        return document | {"kinds": kinds, "frame": "x, y, z in mm; z = 0 at the bottom of the clear layer"}

    @property
    def caption(self) -> str:
        """Text that explains the lines and numbers in a picture of light paths."""
        lost = (
            "Dotted: rays that reached the receiver while the pad was untouched, followed under the press; crosses: "
            "where they end."
            if self.is_aimed
            else "Dotted: light that reaches no receiver; crosses: where it ends."
        )
        of = "the light that arrived while the pad was untouched" if self.is_aimed else "the emitted light"
        return (
            "Lines are random sample paths of the ray tracer, drawn with a probability proportional to their "
            f"power; kinds with more power have more lines, but weak kinds are overrepresented. {lost} "
            f"Percentages are of {of}, from the light model, not from counts of lines. The section shows "
            f"paths projected from the side. Seed {self.seed}."
        )

    @property
    def title(self) -> str:
        """Title of the picture."""
        if "-" in self.name:
            light = f"light from {self.name.replace('-', ' to ')}"
        elif self.name == "all":
            light = "light of all emitters"
        else:
            light = f"light {'to' if self.is_aimed else 'of'} {self.name}"
        return f"{self.design.name}: {light}"


def _state_json(state: RayState, unit: float) -> dict[str, Any]:
    drawn = [kind_of(path.fate).key for path in state.paths]
    return {
        "press_mm": list(state.press_mm),
        "flux_by_class": {name: float(flux.sum()) / state.emitters for name, flux in state.power.items()},
        "share_by_kind": {key: power / unit for key, power in state.power_by_kind.items()},
        "share": state.total / unit,
        "paths_by_kind": {key: drawn.count(key) for key in dict.fromkeys(drawn)} | {"lost": len(state.lost)},
    }


def _path_json(path: LightPath, cavity: CavityGeometry) -> dict[str, Any]:
    return {
        "class": path.fate,
        "kind": kind_of(path.fate).key,
        "emitter": cavity.emitters[path.emitter].name,
        "receiver": _receiver_name(cavity, path.receiver),
        "ray": path.ray,
        "places_mm": path.places_mm.round(4).tolist(),
    }


def _receiver_name(cavity: CavityGeometry, number: int) -> str | None:
    return None if number < 0 else cavity.receivers[number].name

"""One centred press: surface, load, pressure, and the load over a protocol, for the terminal and for JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.arrays import FloatArray
from optopad.design.fields.quantity import Quantity
from optopad.design.press_protocol import LoadProtocol
from optopad.design.spec import SensorDesign
from optopad.screen.answer import Result
from optopad.sims.contact.force_curve import ForceCurve, LoadComparison
from optopad.sims.contact.load_protocol import LoadHistory
from optopad.sims.contact.pressure import ContactPressure
from optopad.sims.press import Indentation

HOW_TO_RELAX = (
    "press and retract have the same load, because relaxation is off; to turn it on, give values measured on the "
    "built pad: --set elastomer.viscoelastic.relaxed_share=... --set elastomer.viscoelastic.time_constant_s=..."
)


@dataclass(frozen=True, kw_only=True)
class ProtocolView:
    """A load protocol (depth of a press over time), and the load during the protocol."""

    name: str
    protocol: LoadProtocol
    history: LoadHistory
    is_elastic: bool


@dataclass(frozen=True, kw_only=True, repr=False)
class PressView(Result):
    """Results of one centred press.

    Attributes
    ----------
    design : design of the pressed pad
    press : the deformed surface at the requested depth
    tip_mm : outline of the tip: distance from the axis, and height above the tip's lowest point [mm]
    young : Young's modulus used for the loads, with its uncertainty band [MPa]
    force : load against depth
    pressure : contact pressure between tip and pad at the requested depth
    comparison : published and computed load of one press; None without a published load
    driven : the load protocol; None if none was requested
    warnings : warnings about the press
    files : files that were written
    """

    design: SensorDesign
    press: Indentation
    tip_mm: tuple[FloatArray, FloatArray]
    young: Quantity
    force: ForceCurve
    pressure: ContactPressure
    comparison: LoadComparison | None
    driven: ProtocolView | None
    warnings: tuple[str, ...]
    files: tuple[Path, ...] = ()

    @property
    def band_n(self) -> tuple[float, float]:
        """Load at both ends of the uncertainty band of Young's modulus [N]."""
        low, high = (self.force.low_n[-1], self.force.high_n[-1]) / self.force.force_n[-1]
        return float(low) * self.press.force_n, float(high) * self.press.force_n

    @property
    def pile_up_mm(self) -> tuple[float, float]:
        """Height of the highest point of the deformed surface, and that point's distance from the tip's axis [mm]."""
        highest = int(self.press.height_mm.argmax())
        return float(self.press.height_mm[highest]), float(self.press.radius_mm[highest])

    def lines(self) -> list[str]:
        """Text about the press, a few lines, the most important first."""
        press, (height_mm, at_mm) = self.press, self.pile_up_mm
        peak = self.pressure.peak_mpa
        pressed = "not resolved by the mesh" if peak is None else f"{peak:.3g} MPa"
        deepest = float(self.force.depth_mm[-1])
        lines = [
            f"press     {press.depth_mm:g} mm: {self._load(press.force_n, *self.band_n)}",
            f"contact   radius {press.contact_radius_mm:.2f} mm; peak pressure {pressed}",
            f"pile-up   {height_mm * 1000:.0f} um at {at_mm:.1f} mm from the axis",
            f"deepest   {deepest:g} mm: {self._load(*self.force.at(deepest))}",
        ]
        if self.comparison is not None:
            lines.append(f"stated    {self.comparison.stated.source}")
            lines.append(f"          {self.comparison.words}")
        if self.driven is not None:
            lines += _protocol_lines(self.driven)
        return lines + [f"warning   {note}" for note in self.warnings]

    def screen(self) -> list[str]:
        """The press, and its pictures."""
        return [*self.lines(), *([f"files     {self.files[0].parent}/contact-*"] if self.files else [])]

    def _load(self, force_n: float, low_n: float, high_n: float) -> str:
        young = self.young
        if not self.force.has_band:
            return f"{force_n:.2f} N at a modulus of {young.value:.3g} MPa ({young.confidence})"
        return (
            f"{force_n:.2f} N ({low_n:.2f} to {high_n:.2f} N over the modulus's band, {young.low:.3g} to "
            f"{young.high:.3g} MPa, {young.confidence})"
        )

    def to_json(self) -> dict[str, Any]:
        """Data about the press for JSON; unknown values are None."""
        press, force, pressure = self.press, self.force, self.pressure
        return {
            "name": self.design.name,
            "digest": self.design.digest,
            "depth_mm": press.depth_mm,
            "force_n": press.force_n,
            "force_band_n": list(self.band_n) if force.has_band else None,
            "contact_radius_mm": press.contact_radius_mm,
            "pile_up_mm": dict(zip(("height", "radius"), self.pile_up_mm, strict=True)),
            **_lists(press, "radius_mm", "height_mm"),
            "modulus_mpa": self.young.model_dump(mode="json"),
            "pressure": {
                **_lists(pressure, "radius_mm", "pressure_mpa"),
                "peak_mpa": pressure.peak_mpa,
                "is_resolved": pressure.is_resolved,
            },
            "curve": _lists(force, "depth_mm", "force_n", "low_n", "high_n", "contact_radius_mm"),
            "stated": None if self.comparison is None else _comparison_json(self.comparison),
            "protocol": None if self.driven is None else _protocol_json(self.driven),
            "warnings": list(self.warnings),
            "files": [str(file) for file in self.files],
        }


def _lists(found: object, *names: str) -> dict[str, Any]:
    return {name: getattr(found, name).tolist() for name in names}


def _protocol_lines(driven: ProtocolView) -> list[str]:
    protocol, history = driven.protocol, driven.history
    steps = protocol.steps
    inward, outward = history.pause_ends[:steps], history.pause_ends[steps - 1 :][::-1]
    lines = [
        f"protocol  {protocol.title}",
        f"          speed {protocol.speed_mm_per_s.value:g} mm/s ({protocol.speed_mm_per_s.confidence}: "
        f"{protocol.speed_mm_per_s.source})",
        "          depth [mm]  load after the pause [N], in / out",
    ]
    for going_in, coming_out in zip(inward, outward[1:], strict=True):
        lines.append(
            f"          {history.depth_mm[going_in]:10g}  {history.load_n[going_in]:.2f} / "
            f"{history.load_n[coming_out]:.2f}"
        )
    if driven.is_elastic:
        return [*lines, f"          {HOW_TO_RELAX}"]
    return [*lines, f"          work dissipated in the pad {history.lost_mj:.3g} mJ"]


def _comparison_json(comparison: LoadComparison) -> dict[str, Any]:
    return {
        "depth_mm": comparison.stated.depth_mm,
        "stated_n": comparison.stated.force_n,
        "source": comparison.stated.source,
        "computed_n": comparison.force_n,
        "computed_band_n": [comparison.low_n, comparison.high_n],
        "miss": comparison.miss,
        "is_in_band": comparison.is_in_band,
        "needed_modulus_mpa": comparison.needed_modulus_mpa,
    }


def _protocol_json(driven: ProtocolView) -> dict[str, Any]:
    history = driven.history
    return {
        "name": driven.name,
        **driven.protocol.model_dump(mode="json"),
        "is_elastic": driven.is_elastic,
        "note": HOW_TO_RELAX if driven.is_elastic else None,
        "time_s": history.time_s.tolist(),
        "path_mm": history.depth_mm.tolist(),
        **_lists(history, "load_n", "elastic_n", "has_left", "pause_ends"),
        "lost_mj": history.lost_mj,
    }

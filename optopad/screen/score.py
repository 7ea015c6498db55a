"""The result of a score: the verdict on a design, with figures, maps and plots."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from optopad.design.errors import InputError
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.screen.answer import WIDTH_IN, block, drawn, picture
from optopad.screen.figures import summary_words
from optopad.screen.verdict import answer_of
from optopad.screen.verdict_sentences import sentences_of
from optopad.sims.score.result import ContinuityScore, JudgedPair, KeyFigures

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, init=False, repr=False)
class Score(KeyFigures):
    """The verdict on a design: figures, maps and plots.

    Attributes
    ----------
    design : the design that was scored
    found : the whole score: pairs, map, bounds and effects of tolerances
    """

    design: SensorDesign
    found: ContinuityScore

    def __init__(self, *, design: SensorDesign, found: ContinuityScore) -> None:
        figures = {one.name: getattr(found, one.name) for one in fields(KeyFigures)}
        vars(self).update(figures, design=design, found=found)

    @property
    def deadband_mm(self) -> float:
        """Sum of the deadbands' extents in depth [mm]."""
        return self.found.deadband_total_mm

    @property
    def pairs(self) -> tuple[str, ...]:
        """Names of the pairs for which the score reports modes and deadbands."""
        return tuple(pair.name for pair in self.found.pairs)

    def to_dict(self) -> dict[str, Any]:
        """The data of `score.json` in a bundle."""
        return self.found.to_json()

    @cached_property
    def maps(self) -> xr.Dataset:
        """Deadbands, bounds and detection threshold at each location; the data of `maps.nc` in a bundle.

        Raises
        ------
        InputError : the models do not cover this design.
        """
        from optopad.sims.score.maps_file import maps_dataset

        return maps_dataset(self.design, self._answered())

    @cached_property
    def signals(self) -> xr.Dataset:
        """(state, emitter, receiver) light under the map's presses (states), as in the bundle's `signals.nc`.

        Raises
        ------
        InputError : the models do not cover this design.
        """
        from optopad.sims.readings.readout import signals_dataset

        light, readout = self._answered().pad_signals, self.found.readout
        assert light is not None
        assert readout is not None
        return signals_dataset(light, cavity_of(self.design), counts_per_flux=readout.counts_per_flux)

    def plot_signal(self, pair: str | None = None, ax: Axes | None = None) -> Axes:
        """Plot the signal of a pair against depth, with its modes and deadbands.

        pair : name of the pair; None for the governing pair, whose deadband decides the verdict

        Raises
        ------
        InputError : the score has no pair of this name.
        """
        from optopad.sims.plots.signal import plot_signal

        return drawn(lambda own: plot_signal(self._pair(pair), own), ax, 3.6)

    def plot_pairs(self, ax: Axes | None = None) -> Axes:
        """Plot the depths of modes and deadbands of every pair in `pairs`."""
        from optopad.sims.plots.style import plot_spans

        pairs = self._answered().pairs
        return drawn(lambda own: plot_spans(pairs, own), ax, 1.0 + 0.22 * len(self.pairs))

    def plot_map(self, ax: Axes | None = None) -> Axes:
        """Plot the deadband at each location of the pad."""
        from optopad.sims.plots.maps import plot_deadband_map

        found = self._answered().pad_map
        assert found is not None
        return drawn(lambda own: plot_deadband_map(found, cavity_of(self.design), own), ax, 4.8)

    def plot_margin(self, ax: Axes | None = None) -> Axes:
        """Plot the margin at each location, in standard deviations of the noise; a margin below 3 means a deadband."""
        from optopad.sims.plots.maps import plot_margin_map

        found = self._answered().pad_map
        assert found is not None
        return drawn(lambda own: plot_margin_map(found, cavity_of(self.design), own), ax, 4.8)

    def plot_tolerance(self, ax: Axes | None = None) -> Axes:
        """Plot the deadband of the governing pair at both ends of every unmeasured parameter's uncertainty band."""
        from optopad.sims.plots.tolerance import plot_tolerance

        band = self._answered().tolerance
        assert band is not None
        return drawn(lambda own: plot_tolerance(band, own), ax, 1.2 + 0.3 * len(band.rows))

    def __repr__(self) -> str:
        size = summary_words(self.design, self.found)
        return "\n".join(answer_of(self.design, self.found, size).lines(()))

    def _repr_html_(self) -> str:
        said = sentences_of(self.design, self.found)
        head = f"{self.found.name} ({self.found.digest[:8]})"
        rest = [
            text for text in (said.verdict, said.why, said.margin, said.confidence, said.resolution) if text
        ]
        if self.verdict == "OUT_OF_MODEL_SCOPE":
            return block(head, rest)
        return block(head, rest, picture(self._sheet, f"score-{self.design.digest[:8]}"))

    def _sheet(self) -> Figure:
        from matplotlib.figure import Figure

        sheet = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
        self.plot_signal(ax=sheet.add_subplot())
        return sheet

    def _pair(self, name: str | None) -> JudgedPair:
        found = self._answered()
        wanted = found.governing if name is None else name
        for pair in found.pairs:
            if pair.name == wanted:
                return pair
        raise InputError(f"plot_signal: {wanted!r} is no judged pair; there are {', '.join(self.pairs)}")

    def _answered(self) -> ContinuityScore:
        if self.found.pad_map is None or not self.found.pairs:
            raise InputError(f"{self.design.name}: nothing was computed, {self.reason or 'a verdict only'}")
        return self.found

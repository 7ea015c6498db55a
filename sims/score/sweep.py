"""Sweep of one field of a design: each value is judged, and the results are plain data for table, plot and file.

An entry of a sweep (`SweepRow`) is the result at one value: the score without tolerance, and the light of one pair.
Entries are stored in a file and plotted later without new computation. For facing rows the pair is the middle one at
every value, even if another pair decides the verdict, so that the panels of a figure are comparable. For a pad it is
the governing pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from optopad.design.errors import DesignError, InputError
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.sims.contact.scope import contact_of
from optopad.sims.score.result import ContinuityScore, JudgedPair, headline
from optopad.sims.verdict.figure_errors import BoundaryForces, boundary_forces, place_force
from optopad.sims.verdict.pair_score import total_length_mm

SAMPLING_MM = 0.15
"""Error of a deadband's length due to depth steps [mm]: its change if they are doubled (docs/understand/model.md)."""


@dataclass(frozen=True, kw_only=True)
class SweptCurve:
    """Light of the plotted pair against depth.

    Attributes
    ----------
    pair : name of the pair, such as E1-R3
    depth_mm : depths [mm]
    total, direct, top : received divided by emitted power at each depth: in total, on the direct path, and mirrored by
        the top [-]
    standard_error : standard error of total, from the light trace [-]
    """

    pair: str
    depth_mm: tuple[float, ...]
    total: tuple[float, ...]
    direct: tuple[float, ...]
    top: tuple[float, ...]
    standard_error: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class SweepRow:
    """Result of a sweep at one value of the field.

    Attributes
    ----------
    value : the field's value
    score : the score as plain data, as in ``score.json``
    curve : light of the plotted pair; None if the value is out of the models' scope
    forces_n : loads at the plotted pair's mode boundaries, with their range over the band of the elastic modulus [N];
        None if the value is out of the models' scope
    possible_deadband_mm : total deadband of the plotted pair, including deadbands that the numerical error may hide
        [mm]; None if not computed
    refined : "full" or "fine" if the value was judged again with this option of `score`; otherwise empty
    """

    value: Any
    score: dict[str, Any]
    curve: SweptCurve | None
    forces_n: dict[str, Any] | None
    possible_deadband_mm: float | None
    refined: str = ""

    @property
    def is_judged(self) -> bool:
        """Whether the design is in the models' scope at this value."""
        return self.curve is not None

    @property
    def shown(self) -> dict[str, Any]:
        """The plotted pair's part of the score as plain data; empty if out of the models' scope."""
        name = None if self.curve is None else self.curve.pair
        return next((pair for pair in self.score["pairs"] if pair["pair"] == name), {})

    @property
    def is_of_another_pair(self) -> bool:
        """Whether the score's deadband belongs to a pair other than the plotted one."""
        return bool(self.score["deadband_mm"]["total"]) and self.score["governing_pair"] != self.shown.get(
            "pair"
        )

    @property
    def asked_mm(self) -> float | None:
        """Deepest press that the design requires [mm]; None if out of the models' scope."""
        force = self.score["force"]
        return None if force is None else float(force["depth_mm"][-1])

    @property
    def lost_mm(self) -> float:
        """Part of the required depth that is not resolved: deadbands, and depths beyond the usable depth [mm]."""
        asked, usable = self.asked_mm, self.score["usable_depth_mm"]
        beyond = 0.0 if asked is None or usable is None else max(asked - usable, 0.0)
        return float(self.score["deadband_mm"]["total"] or 0.0) + beyond

    @property
    def headline(self) -> str:
        """The verdict in the words of `optopad score`, in short form."""
        return headline(
            self.score["verdict"],
            is_open=self.score["is_open"],
            usable_mm=self.score["usable_depth_mm"],
            asked_mm=self.asked_mm,
            is_short=True,
        )

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON: the value, all entries of a score, headline, light curve and loads."""
        return {
            "value": self.value,
            "headline": self.headline,
            "refined": self.refined,
            **self.score,
            "curve": None if self.curve is None else asdict(self.curve),
            "mode_forces_n": self.forces_n,
            "possible_deadband_mm": self.possible_deadband_mm,
        }

    @classmethod
    def from_json(cls, document: dict[str, Any]) -> SweepRow:
        """The entry from the plain data that `to_json` returned."""
        own = ("value", "headline", "refined", "curve", "mode_forces_n", "possible_deadband_mm")
        return cls(
            value=document["value"],
            score={name: found for name, found in document.items() if name not in own},
            curve=None if document["curve"] is None else _curve_of(document["curve"]),
            forces_n=document["mode_forces_n"],
            possible_deadband_mm=document["possible_deadband_mm"],
            refined=document["refined"],
        )


def sweep_row(design: SensorDesign, value: Any, score: ContinuityScore) -> SweepRow:
    """The entry for one judged value of the swept field.

    Parameters
    ----------
    design : design with the field at that value
    value : value of the field
    score : score of that design
    """
    if not score.pairs:
        return SweepRow(
            value=value, score=score.to_json(), curve=None, forces_n=None, possible_deadband_mm=None
        )
    governing = next(pair for pair in score.pairs if pair.name == score.governing)
    pair = score.pairs[0] if score.is_facing_rows else governing
    possible = pair.score.possible_deadbands_mm
    return SweepRow(
        value=value,
        score=score.to_json(),
        curve=_curve(pair),
        forces_n=_forces(design, pair).to_json(),
        possible_deadband_mm=None if possible is None else round(total_length_mm(possible), 4),
    )


def disputed(rows: Sequence[SweepRow]) -> tuple[int, ...]:
    """Indices of the entries that contradict both of their neighbours, and of these neighbours.

    An entry contradicts its neighbours if its verdict differs from both, or if it loses more depth than both by more
    than the sampling error. (One that loses less than both may be an optimum.) All three are returned, as any of them
    may be wrong. The result is empty if the values are not numbers.
    """
    if not all(isinstance(row.value, int | float) for row in rows):
        return ()
    order = sorted(range(len(rows)), key=lambda number: float(rows[number].value))
    found: set[int] = set()
    for three in zip(order, order[1:], order[2:], strict=False):
        before, row, after = (rows[number] for number in three)
        if before.is_judged and row.is_judged and after.is_judged and _stands_out(before, row, after):
            found.update(three)
    return tuple(sorted(found))


def _stands_out(before: SweepRow, row: SweepRow, after: SweepRow) -> bool:
    verdict = row.score["verdict"]
    if verdict not in (before.score["verdict"], after.score["verdict"]):
        return True
    return row.lost_mm - max(before.lost_mm, after.lost_mm) > SAMPLING_MM


def swept_designs(design: SensorDesign, path: str, values: Sequence[Any]) -> tuple[SensorDesign, ...]:
    """The design at every value of the field, all checked before any computation.

    Raises
    ------
    DesignError : the field is unknown, or a value breaks a rule.
    InputError : a value is given twice.
    """
    doubled = [value for number, value in enumerate(values) if value in values[:number]]
    if doubled:
        raise InputError(f"sweep: {path} = {doubled[0]} is given twice; give each value once")
    return tuple(_valid(design, path, value) for value in values)


def _valid(design: SensorDesign, path: str, value: Any) -> SensorDesign:
    build = design.with_(**{path: value})
    try:
        require_valid(build)
    except DesignError as err:
        raise DesignError(f"sweep: {path} = {value}: {err}") from None
    return build


def _forces(design: SensorDesign, pair: JudgedPair) -> BoundaryForces:
    if pair.forces is not None:
        return pair.forces
    force, is_at_place = place_force(contact_of(design), pair.curves.press_mm)
    return boundary_forces(pair.score.modes, force, is_at_place=is_at_place)


def _curve_of(document: dict[str, Any]) -> SweptCurve:
    light = {name: tuple(values) for name, values in document.items() if name != "pair"}
    return SweptCurve(pair=document["pair"], **light)


def _curve(pair: JudgedPair) -> SweptCurve:
    curves = pair.curves

    def kept(values: Any) -> tuple[float, ...]:
        return tuple(float(f"{value:.7g}") for value in values)

    return SweptCurve(
        pair=pair.name,
        depth_mm=kept(curves.depth_mm),
        total=kept(curves.total),
        direct=kept(curves.direct),
        top=kept(curves.top),
        standard_error=kept(curves.standard_error),
    )

"""Readings of a pad for batches of presses or of objects' poses, without a simulator."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import ThreadpoolController

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.held_object import held_of
from optopad.design.spec import SensorDesign
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.readings.protocol import untouched_readout
from optopad.sims.readings.signal_chain import SignalChain, chain_of
from optopad.sims.robot.fast_light import FastLight, Imprint, light_of, require_light_of
from optopad.sims.robot.poses import posed
from optopad.sims.robot.shapes import Shape

AT_ONCE = 125
"""States that are computed together, so that a core's cache holds their arrays."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Forward:
    """The readings of a pad as a function of what touches it.

    Readings are signals without noise, shape (n, emitters, receivers) [counts]; with a seed, those of one noisy frame
    each, as `optopad simulate` draws them. Deeper objects than `light.deepest_mm` count as that deep.

    Attributes
    ----------
    design : the design
    light : its map of light
    chain : gains, noise and range of the readings
    """

    design: SensorDesign
    light: FastLight
    chain: SignalChain

    @property
    def untouched(self) -> FloatArray:
        """Readings of the untouched pad, shape (emitters, receivers) [counts]."""
        return np.asarray(np.minimum(self.light.untouched * self.chain.gains, self.chain.full_scale_counts))

    def presses(self, press_mm: ArrayLike, *, seed: int | None = None) -> FloatArray:
        """Readings of presses by the design's tip; x, y and depth in the cavity, shape (n, 3) [mm]."""
        given = _rows("press_mm", press_mm, 3)
        self._require_on_pad(given)
        tip = Shape(kind="sphere", size_mm=np.array([self.light.tip_radius_mm, 0.0, 0.0]))
        x, y, depth = given.T
        top = self.light.top
        foot = np.column_stack([x, y, top.height_mm(x, y)])
        centre = foot + top.normal(x, y) * (self.light.tip_radius_mm - depth)[:, None]
        return self.poses(tip, centre, np.broadcast_to(np.eye(3), (len(x), 3, 3)), seed=seed)

    def objects(self, text: str, press_mm: ArrayLike, *, seed: int | None = None) -> FloatArray:
        """Readings of presses (n, 3) by an object as of `optopad press --object`, such as ``cylinder,radius=5``."""
        held, given = held_of(text), _rows("press_mm", press_mm, 3)
        self._require_on_pad(given)
        found = [posed(held, self.light.top, (x, y), depth) for x, y, depth in given.tolist()]
        centre, turn = (np.array([one[k] for one in found]) for k in (1, 2))
        return self.poses(found[0][0], centre, turn, seed=seed)

    def poses(
        self, shape: Shape, centre_mm: ArrayLike, turn: ArrayLike, *, seed: int | None = None
    ) -> FloatArray:
        """Readings of a shape in n poses in cavity coordinates.

        Parameters
        ----------
        centre_mm, turn : (n, 3) centres [mm] and (n, 3, 3) rotations; columns of a rotation are the shape's axes
        """
        centre, turns = _rows("centre_mm", centre_mm, 3), np.asarray(turn, dtype=np.float64)
        if turns.shape != (len(centre), 3, 3):
            raise InputError(f"turn: has the shape {turns.shape}, needs ({len(centre)}, 3, 3)")
        flux: FloatArray = np.empty((len(centre), *self.light.untouched.shape))

        def put(number: int) -> None:
            own = slice(number * AT_ONCE, (number + 1) * AT_ONCE)
            flux[own] = self.of_imprint(self.light.imprint(shape, centre[own], turns[own]))

        with _threads().limit(limits=1):
            run_each(put, -(-len(centre) // AT_ONCE))
        return self._read(flux, seed)

    def _require_on_pad(self, press_mm: FloatArray) -> None:
        for row in np.flatnonzero(~self.light.nodes.contain(press_mm))[:1]:
            x, y = press_mm[row, :2]
            raise InputError(f"press_mm: row {row}: ({x:g}, {y:g}) mm is outside the pad; press inside")

    def of_imprint(self, imprint: Imprint) -> FloatArray:
        """Flux (n, emitter, receiver) of any objects, as a share of the emitted power [-]."""
        return np.asarray(self.light.untouched * self.light.ratios(imprint))

    def _read(self, flux: FloatArray, seed: int | None) -> FloatArray:
        if seed is None:
            return np.minimum(flux * self.chain.gains, self.chain.full_scale_counts)
        counts = self.chain.counts(flux, np.zeros(len(flux)), np.random.default_rng(seed)).astype(np.float64)
        return np.asarray(counts[:, :-1] - counts[:, -1:])


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()


def forward(design: SensorDesign, light: FastLight | str | os.PathLike[str] | None = None) -> Forward:
    """The readings of a design's pad as a function of what touches it.

    Parameters
    ----------
    light : map of light, or its file; if None, the one that `optopad scene DESIGN --fit` stored

    Raises
    ------
    InputError : no map of light was fitted for the design, or the given one is of another.
    """
    found = light if isinstance(light, FastLight) else light_of(design, light)
    require_light_of(design, found.digest)
    chain = chain_of(design, untouched_readout(design, found.untouched))
    return Forward(design=design, light=found, chain=chain)


def _rows(name: str, given: ArrayLike, columns: int) -> FloatArray:
    rows: FloatArray = np.asarray(given, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != columns or not len(rows) or not np.isfinite(rows).all():
        raise InputError(
            f"{name}: has the shape {rows.shape}, needs finite numbers (n, {columns}), n of 1 or more"
        )
    return rows

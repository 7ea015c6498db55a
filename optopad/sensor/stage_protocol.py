"""Presses for a stage from a press protocol of `optopad.design.press_protocol`, locations shuffled within each set."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from optopad.design.press_protocol import load_protocol_file
from optopad.design.recordings import SetEntry
from optopad.design.spec import SensorDesign
from optopad.fabrication.stage.stage import Position, PressList, press_list


def protocol_presses(design: SensorDesign, protocol: str, *, seed: int = 0) -> PressList:
    """The presses of a protocol on a design.

    Parameters
    ----------
    protocol : name of a packaged protocol, or a file
    seed : seed of the order of locations within each set

    Raises
    ------
    DesignError, InputError, ModelScopeError : the protocol does not exist or does not suit this design.
    """
    said = load_protocol_file(protocol)
    depths = said.depth_mm.tolist()

    def rows() -> Iterator[tuple[SetEntry, int, Position]]:
        for number, (one, places) in enumerate(zip(said.sets, said.places_mm(design), strict=True)):
            order = np.random.default_rng([seed, number]).permutation(len(places))
            for place, (x, y) in enumerate(places[order].tolist()):
                yield from ((one.info, place, (x, y, depth)) for depth in depths)

    return press_list(rows())

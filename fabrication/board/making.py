"""Makes the board of a design: places the parts and routes their connections."""

from __future__ import annotations

from optopad.design.spec import SensorDesign
from optopad.fabrication.board.model import Board
from optopad.fabrication.board.placement import placed
from optopad.fabrication.board.pour import with_pour
from optopad.fabrication.board.router import routed
from optopad.fabrication.gain import SimulatedGain


def board_of(design: SensorDesign, gain: SimulatedGain | None = None) -> Board:
    """The circuit board of a design, routed as far as possible (`Board.unrouted`).

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are left open

    Raises
    ------
    DesignError : a chip's package or pins are not known, or the microcontroller board lacks a required pin.
    """
    return with_pour(routed(placed(design, gain)))

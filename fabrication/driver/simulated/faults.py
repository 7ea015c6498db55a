"""Faults of a unit: the simulated board can show them, and `optopad driver check` must find them.

swap:E1,E2        wires of two emitters exchanged; swap:R1,R2 wires of two receivers
dead:E3, dead:R4  a part without any signal
saturated:R5      an amplifier that stays at full scale
dim:E2            a part with a fifth of its signal
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.fabrication.driver_file import DriverConfig

DIM_SHARE = 0.2
KINDS = ("swap", "dead", "saturated", "dim")


@dataclass(frozen=True, kw_only=True)
class Faults:
    """Effect of a simulated unit's faults on its signals.

    Attributes
    ----------
    emitter_of_pin : for each emitter pin, the index of the emitter that is connected to it
    receiver_of_channel : for each channel, the index of the receiver that is connected to it
    emitter_share, receiver_share : for each part, the fraction of its signal that remains [-]
    is_saturated : for each channel, whether it stays at full scale
    """

    emitter_of_pin: NDArray[np.intp]
    receiver_of_channel: NDArray[np.intp]
    emitter_share: FloatArray
    receiver_share: FloatArray
    is_saturated: BoolArray

    def applied(self, signals: FloatArray) -> FloatArray:
        """Signals of the faulty unit from `signals` without faults, both of shape (..., emitters, receivers) [counts].

        The axes of the result are emitter pins and channels.
        """
        left = signals * self.emitter_share[:, None] * self.receiver_share
        found: FloatArray = left[..., self.emitter_of_pin, :][..., self.receiver_of_channel]
        return found


@dataclass
class _Draft:
    emitters: list[int]
    receivers: list[int]
    shares: dict[str, float] = field(default_factory=dict)
    saturated: set[str] = field(default_factory=set)


def faults_of(config: DriverConfig, texts: Iterable[str] = ()) -> Faults:
    """Parse faults from texts such as `swap:E1,E2` (types of faults: swap, dead, saturated, dim).

    Raises
    ------
    InputError : a fault's type or part is unknown, or a fault has the wrong number of parts.
    """
    names = {"E": [e.name for e in config.emitters], "R": [r.name for r in config.receivers]}
    draft = _Draft(emitters=list(range(len(names["E"]))), receivers=list(range(len(names["R"]))))
    for text in texts:
        _add(draft, names, text)
    return Faults(
        emitter_of_pin=np.array(draft.emitters),
        receiver_of_channel=np.array(draft.receivers),
        emitter_share=np.array([draft.shares.get(name, 1.0) for name in names["E"]]),
        receiver_share=np.array([draft.shares.get(name, 1.0) for name in names["R"]]),
        is_saturated=np.array([name in draft.saturated for name in names["R"]]),
    )


def _add(draft: _Draft, names: dict[str, list[str]], text: str) -> None:
    kind, _, listed = text.partition(":")
    parts = [part.strip() for part in listed.split(",") if part.strip()]
    known = [*names["E"], *names["R"]]
    strange = [part for part in parts if part not in known]
    if kind not in KINDS or strange or len(parts) != (2 if kind == "swap" else 1):
        raise InputError(
            f"fault {text!r} is refused{': no ' + strange[0] if strange else ''}; write swap:E1,E2, dead:E3, "
            f"dim:E3 or saturated:R5, with parts {known[0]} to {names['E'][-1]} and {names['R'][0]} to {known[-1]}"
        )
    if kind == "swap":
        _swap(draft, names, *parts)
    elif kind == "saturated":
        if parts[0] not in names["R"]:
            raise InputError(f"fault {text!r} is refused: a receiver's amplifier saturates, as saturated:R1")
        draft.saturated.add(parts[0])
    else:
        draft.shares[parts[0]] = 0.0 if kind == "dead" else DIM_SHARE


def _swap(draft: _Draft, names: dict[str, list[str]], one: str, other: str) -> None:
    is_emitter = [part in names["E"] for part in (one, other)]
    if is_emitter[0] != is_emitter[1] or one == other:
        raise InputError(f"fault 'swap:{one},{other}' is refused: name two emitters or two receivers")
    table, row = (draft.emitters, names["E"]) if is_emitter[0] else (draft.receivers, names["R"])
    a, b = row.index(one), row.index(other)
    table[a], table[b] = table[b], table[a]

"""One emitter's light in one state as a row of numbers, stored under a name that is a hash of all its inputs.

A row depends on the block and its materials, all receivers (their faces absorb), this emitter, its number (which
selects its sample points), this state's top, the requested pairs (several reflections are sampled for them), settings
and seed. It also depends on the source code of the light model, its libraries, and the processor for which they are
compiled. No other emitter or state matters, so neither is in its name.

A row's name cannot be computed without its top. If the tops come from presses of a design, the list of all row names is
stored, too, under one name for all inputs. The light of the same presses is then found without computing any top.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.cache import folder_fingerprint
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.scene.optical_scene import OpticalScene

NAME_BYTES = 20
FORMAT = 1
"""Version of the rows' layout; part of every name."""


class KeptRows(Protocol):
    """Store of rows of light that are kept after a trace; rows are found by name."""

    def read(self, names: Sequence[bytes]) -> dict[bytes, bytes]:
        """Stored rows by name; missing ones are left out."""

    def write(self, rows: Mapping[bytes, bytes]) -> None:
        """Store rows under their names."""


class Tops(Protocol):
    """Tops of all states as arrays, which determine the light.

    Attributes
    ----------
    rows : (state, ...) numbers and tables of the presses
    field : for each state the nodes of its smooth field or grid
    """

    @property
    def rows(self) -> FloatArray:
        """(state, ...) numbers and tables of the presses."""

    @property
    def field(self) -> Sequence[FloatArray] | FloatArray:
        """For each state the nodes of its smooth field or grid."""


def row_names(
    scene: OpticalScene,
    tops: Tops,
    states: IntArray,
    asked: BoolArray,
    settings: Accuracy,
    seed: int,
) -> list[list[bytes]]:
    """Name of the row of each state and emitter.

    Parameters
    ----------
    scene : the pad
    tops : tops of all states
    states : (n,) numbers of the states
    asked : (n, emitter, receiver) mask of the requested pairs
    settings, seed : accuracy and seed
    """
    common = _hash_of(FORMAT, _origin(), settings, seed, *_shared_fields(scene))
    emitters = [
        b"".join(_bytes_of(part) for part in (number, *row))
        for number, row in enumerate(_emitter_rows(scene))
    ]
    names = []
    for number, of_state in zip(states, asked, strict=True):
        state = common.copy()
        state.update(_bytes_of(tops.rows[number]) + _bytes_of(tops.field[number]))
        names.append([_named(state, own, wanted) for own, wanted in zip(emitters, of_state, strict=True)])
    return names


def names_of(content: bytes | None, states: int, emitters: int) -> list[list[bytes]] | None:
    """Row names by state and emitter, from stored bytes; None if there are too many or too few bytes."""
    if content is None or len(content) != NAME_BYTES * states * emitters:
        return None
    each = [content[start : start + NAME_BYTES] for start in range(0, len(content), NAME_BYTES)]
    return [each[start : start + emitters] for start in range(0, len(each), emitters)]


def name_of_names(source: bytes, asked: BoolArray, settings: Accuracy, seed: int) -> bytes:
    """Name under which the names of the rows of many states are stored.

    Parameters
    ----------
    source : bytes that identify the inputs of all states' tops; equal bytes always give the same tops
    asked : (n, emitter, receiver) mask of the requested pairs
    settings, seed : accuracy and seed
    """
    return _hash_of(FORMAT, _origin(), source, asked, settings, seed).digest()


def row_of(content: bytes, shape: tuple[int, ...]) -> FloatArray | None:
    """A stored row as an array of the given shape; None if it has another size or is not finite."""
    if len(content) != 8 * int(np.prod(shape)):
        return None
    row = np.frombuffer(content, dtype="<f8").reshape(shape)
    return row if np.isfinite(row).all() else None


def content_of(row: FloatArray) -> bytes:
    """Bytes of a row, for the store."""
    return row.astype("<f8").tobytes()


def _named(state: hashlib.blake2b, emitter: bytes, wanted: BoolArray) -> bytes:
    name = state.copy()
    name.update(emitter + wanted.tobytes())
    return name.digest()


def _hash_of(*parts: object) -> hashlib.blake2b:
    digest = hashlib.blake2b(digest_size=NAME_BYTES)
    for part in parts:
        digest.update(_bytes_of(part))
    return digest


def _bytes_of(part: object) -> bytes:
    """Type, shape and content of a value as bytes; two different lists of values never give the same bytes."""
    if isinstance(part, np.ndarray):
        return f"{part.dtype.str}{part.shape}:".encode() + part.tobytes()
    return f"{part!r}:".encode()


def _shared_fields(scene: OpticalScene) -> list[object]:
    """Names and values of all fields of a scene but those of its emitters; fields added later are included."""
    return [
        item
        for field in fields(scene)
        if not field.name.startswith("emitter_")
        for item in (field.name, getattr(scene, field.name))
    ]


def _emitter_rows(scene: OpticalScene) -> list[list[object]]:
    columns = [
        (field.name, getattr(scene, field.name))
        for field in fields(scene)
        if field.name.startswith("emitter_")
    ]
    return [
        [
            item
            for name, values in columns
            for item in (name, None if values is None else np.asarray(values[k]))
        ]
        for k in range(len(scene.emitter_wall))
    ]


@cache
def _origin() -> str:
    """Fingerprint of source code, libraries and processor, which also determine a row's numbers."""
    import numba
    import scipy
    from numba.core.registry import cpu_target

    room = Path(__file__).parent
    sources = folder_fingerprint(room, room.with_name("scene"), room.with_name("surface"))
    processor = cpu_target.target_context.codegen().magic_tuple()
    return f"{sources} {numba.__version__} {np.__version__} {scipy.__version__} {processor}"

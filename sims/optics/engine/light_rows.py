"""One emitter's light in one state as a row of numbers, and its name: a hash of all its inputs.

A row depends on: the block and its materials; all receivers (their faces absorb); this emitter, and its number (which
selects its points); the top of this state; the requested pairs (several reflections are sampled for them); settings
and seed; the sources of the light model, its libraries, and the processor for which they are compiled. It depends on
no other emitter and no other state, and neither is in its name.

A row's name requires its top. Where tops come from presses of a design, the names are kept too, under one name of all
their inputs: the light of the same presses is then found without any top.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from sims.cache import folder_fingerprint
from sims.optics.accuracy import Accuracy
from sims.optics.scene.optical_scene import OpticalScene

NAME_BYTES = 20
FORMAT = 1
"""Version of a row's layout."""


class KeptRows(Protocol):
    """Rows of light that outlive a trace."""

    def read(self, names: Sequence[bytes]) -> dict[bytes, bytes]:
        """The stored rows."""

    def write(self, rows: Mapping[bytes, bytes]) -> None:
        """Keep rows."""


class Tops(Protocol):
    """Tops of states as arrays, on which light depends.

    Attributes
    ----------
    rows : (state, ...) numbers and tables of the presses; field : (state, ...) nodes of smooth fields
    """

    @property
    def rows(self) -> FloatArray:
        """Numbers and tables of the presses."""

    @property
    def field(self) -> FloatArray:
        """Nodes of smooth fields."""


def row_names(
    scene: OpticalScene,
    tops: Tops,
    states: IntArray,
    asked: BoolArray,
    settings: Accuracy,
    seed: int,
) -> list[list[bytes]]:
    """Per state and emitter, the name of its row.

    Parameters
    ----------
    states : (n,) numbers of the tops
    asked : (n, emitter, receiver) requested pairs
    """
    common = _hash_of(FORMAT, _origin(), settings, seed, *_shared_fields(scene))
    emitters = [
        b"".join(_bytes_of(part) for part in (number, *row))
        for number, row in enumerate(_emitter_rows(scene))
    ]
    names = []
    for row, nodes, of_state in zip(tops.rows[states], tops.field[states], asked, strict=True):
        state = common.copy()
        state.update(_bytes_of(row) + _bytes_of(nodes))
        names.append([_named(state, own, wanted) for own, wanted in zip(emitters, of_state, strict=True)])
    return names


def names_of(content: bytes | None, states: int, emitters: int) -> list[list[bytes]] | None:
    """Kept names of rows, per state and emitter; None where their number differs."""
    if content is None or len(content) != NAME_BYTES * states * emitters:
        return None
    each = [content[start : start + NAME_BYTES] for start in range(0, len(content), NAME_BYTES)]
    return [each[start : start + emitters] for start in range(0, len(each), emitters)]


def name_of_names(source: bytes, asked: BoolArray, settings: Accuracy, seed: int) -> bytes:
    """Name under which the names of the rows of many states are kept.

    Parameters
    ----------
    source : identifies the inputs of the tops of all states; equal bytes always give the same tops
    """
    return _hash_of(FORMAT, _origin(), source, asked, settings, seed).digest()


def row_of(content: bytes, shape: tuple[int, ...]) -> FloatArray | None:
    """A kept row as an array of the given shape; None where it is of another size or not finite."""
    if len(content) != 8 * int(np.prod(shape)):
        return None
    row = np.frombuffer(content, dtype="<f8").reshape(shape)
    return row if np.isfinite(row).all() else None


def content_of(row: FloatArray) -> bytes:
    """A row's bytes."""
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
    """Kind, shape and content, so that no two lists of parts have the same bytes."""
    if isinstance(part, np.ndarray):
        return f"{part.dtype.str}{part.shape}:".encode() + part.tobytes()
    return f"{part!r}:".encode()


def _shared_fields(scene: OpticalScene) -> list[object]:
    """All fields of a scene except its emitters, by name: a field added to scenes is in every name at once."""
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
    """Sources, libraries and processor that determine a row's bits."""
    import numba
    import scipy
    from numba.core.registry import cpu_target

    room = Path(__file__).parent
    sources = folder_fingerprint(room, room.with_name("scene"), room.with_name("surface"))
    processor = cpu_target.target_context.codegen().magic_tuple()
    return f"{sources} {numba.__version__} {np.__version__} {scipy.__version__} {processor}"

"""Damage to files: of their bytes, and of what they hold while their checksums are right."""

from __future__ import annotations

import io
import json
import tomllib
import zipfile
from pathlib import Path
from random import Random
from typing import Any

import h5py
import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from optopad.fabrication.driver_file import CHECKSUM, content_sha256
from optopad.sims.learning.inference.model_file import _checksum
from tests.fuzz.bad_texts import DOCUMENT_FAULTS, Raw, bad_value, damaged_bytes, damaged_text, written

METADATA_BYTES = 9_000
"""Where most headers of a small HDF5 file lie: damage to them says more than damage to readings."""
NUMBERS = (0.0, -1.0, 1e300, -1e300, 1e38, 1e-300, np.nan, np.inf, 2.0**31, 2.0**63, 1e9)


def damage(file: Path, chance: Random) -> str:
    """Damage a file in place; returns how."""
    by_content = {
        ".optomodel": (_archive, _model),
        ".nc": (_netcdf,),
        ".toml": (_text,),
        ".optorec": (_recording,),
        ".mcap": (_messages,),
    }
    faults = [_bytes, *by_content[file.suffix] * 2]
    if file.name == "driver.toml":
        faults += [_driver_file] * 2
    fault = chance.choice(faults)
    fault(file, chance)
    return fault.__name__.strip("_")


def _bytes(file: Path, chance: Random) -> None:
    content = file.read_bytes()
    if file.suffix == ".nc" and chance.random() < 0.7:
        content = _flipped(content[:METADATA_BYTES], chance) + content[METADATA_BYTES:]
    else:
        content = damaged_bytes(content, chance)
    file.write_bytes(content)


def _flipped(content: bytes, chance: Random) -> bytes:
    flipped = bytearray(content)
    for _ in range(chance.choice((1, 5, 50))):
        flipped[chance.randrange(len(content))] = chance.choice((0, 255, chance.randrange(256)))
    return bytes(flipped)


def _text(file: Path, chance: Random) -> None:
    text = file.read_text(encoding="utf-8")
    if chance.random() < 0.6:
        document = tomllib.loads(text)
        for _ in range(chance.choice((1, 2))):
            chance.choice(DOCUMENT_FAULTS[1:3] + DOCUMENT_FAULTS[9:11])(document, chance)
        file.write_text(written(document), encoding="utf-8")
    else:
        file.write_bytes(damaged_text(text, chance))


def _driver_file(file: Path, chance: Random) -> None:
    """Changed values under a checksum that holds, where they can be hashed at all."""
    document = tomllib.loads(file.read_text(encoding="utf-8"))
    _change_some(document, chance)
    try:
        document[CHECKSUM] = content_sha256(tomllib.loads(written(document)))
    except (ValueError, TypeError, RecursionError):
        document[CHECKSUM] = "0" * 64
    file.write_text(written(document), encoding="utf-8")


def _recording(file: Path, chance: Random) -> None:
    """The header of a recording changed."""
    head, _, rest = file.read_bytes().partition(b"\n")
    header = json.loads(head)
    _change_some(header, chance)
    text = json.dumps(header, default=lambda value: value.text if isinstance(value, Raw) else str(value))
    if chance.random() < 0.2:
        text = chance.choice(("[" * 100_000, "{}", "null", '{"format": 1' + "0" * 5_000 + "}", text[:-1]))
    file.write_bytes(text.encode("utf-8", "surrogatepass") + b"\n" + rest)


def _messages(file: Path, chance: Random) -> None:
    """Definitions, and the content, times and order of messages changed, under checksums that hold."""
    with file.open("rb") as stream:
        found = list(make_reader(stream).iter_messages(log_time_order=False))
    share, of_text = chance.choice((0.0, 0.02, 0.5)), chance.choice((0.0, 0.0, 0.3))
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=4096)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in chance.choice((found, found[::-1], found + found)):
            if channel.id not in channels:
                text = damaged_bytes(schema.data, chance) if chance.random() < of_text else schema.data
                number = writer.register_schema(schema.name, schema.encoding, text)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
            time_ns, content = message.log_time, message.data
            if chance.random() < share:
                content = damaged_bytes(content, chance)
                time_ns = chance.choice((time_ns, 0, 2**63 + 1, time_ns + 10**10))
            writer.add_message(channels[channel.id], time_ns, content, time_ns)
        writer.finish()


def _change_some(document: Any, chance: Random) -> None:
    for _ in range(chance.choice((1, 1, 3))):
        inner = document
        while True:
            name = chance.choice(list(inner) if isinstance(inner, dict) else range(len(inner)))
            if not (isinstance(inner[name], dict | list) and inner[name]) or chance.random() < 0.15:
                break
            inner = inner[name]
        inner[name] = bad_value(chance)


def _archive(file: Path, chance: Random) -> None:
    """A member of the archive replaced: another header, another content, no array, many of them."""
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(list(members))
    shape = chance.choice(
        ("(10000000000,)", "(-1,)", "(1e9,)", "(" * 300, "((1,),)", "(True,)", "None", "(2,)" * 50)
    )
    kind = chance.choice(("'<f8'", "'|O'", "'<U9999999'", "'V0'", "[('a', '<f8')]", "'" + "x" * 20_000 + "'"))
    header = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}"
    members[name] = chance.choice(
        (
            b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(64),
            b"\x93NUMPY\x02\x00" + (2**31).to_bytes(4, "little") + header.encode(),
            b"no array",
            b"",
            damaged_bytes(members[name], chance),
            members[name][:128],
        )
    )
    if chance.random() < 0.1:
        members |= {f"a{number}.npy": b"" for number in range(chance.choice((10, 20_000)))}
    with zipfile.ZipFile(file, "w") as archive:
        for member, content in members.items():
            archive.writestr(member, content)


def _model(file: Path, chance: Random) -> None:
    """Header or arrays of a model changed under a checksum that holds."""
    with np.load(file, allow_pickle=False) as found:
        arrays = {name: found[name] for name in found.files if name != "sha256"}
    if chance.random() < 0.4:
        header = json.loads(arrays["header"].tobytes())
        _change_some(header, chance)
        text = json.dumps(header, default=lambda value: value.text if isinstance(value, Raw) else str(value))
        if chance.random() < 0.3:
            text = chance.choice(
                (
                    "[" * 100_000,
                    "null",
                    text[:-3],
                    '{"version": 1' + "0" * 5_000 + "}",
                    text.replace("1", "1e999"),
                )
            )
        arrays["header"] = np.frombuffer(text.encode("utf-8", "surrogatepass"), np.uint8)
    else:
        name = chance.choice([name for name in arrays if name != "header"])
        arrays[name] = _changed(arrays[name], chance)
    arrays["sha256"] = np.frombuffer(_checksum(arrays), np.uint8)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    file.write_bytes(stream.getvalue())


def _changed(array: np.ndarray, chance: Random) -> np.ndarray:
    match chance.randrange(6):
        case 0:
            return np.asarray(array[:0] if array.ndim else 0.0)
        case 1:
            return array[None]
        case 2:
            return np.array(["a"] * array.size).reshape(array.shape)
        case 3:
            return np.full(array.shape, chance.choice(NUMBERS))
        case 4:
            return np.repeat(array, 2, axis=0) if array.ndim else array
        case _:
            changed = array.astype(np.float64).copy()
            changed.flat[chance.randrange(changed.size)] = chance.choice(NUMBERS)
            return changed


def _netcdf(file: Path, chance: Random) -> None:
    """Variables and attributes changed by the library itself."""
    with h5py.File(file, "r+") as held:
        for _ in range(chance.choice((1, 2))):
            names = [name for name, one in held.items() if isinstance(one, h5py.Dataset)]
            name = chance.choice(names)
            if chance.random() < 0.4:
                inner = held if chance.random() < 0.6 or not held[name].attrs else held[name]
                key = chance.choice(
                    [*inner.attrs, "sets", "attributes", "full_scale_counts", "units", "_FillValue"]
                )
                inner.attrs[key] = chance.choice(
                    (
                        "",
                        "x" * 20_000,
                        "\x1b[31m",
                        "[1]",
                        "{}",
                        "null",
                        "[" * 9_000,
                        1.5,
                        np.nan,
                        np.arange(3),
                        "days since x",
                    )
                )
                continue
            values = held[name][()]
            del held[name]
            if chance.random() < 0.5:
                continue
            if chance.random() < 0.3:
                held.create_dataset(name, shape=(2**40,), dtype="f4", chunks=(1024,))
            elif values.dtype.kind in "fiu":
                changed = _changed(values, chance) if chance.random() < 0.7 else np.array(b"a")
                held[name] = changed.astype("S") if changed.dtype.kind == "U" else changed
            else:
                held[name] = chance.choice((np.arange(3.0), np.bytes_(b"\xff\xfe"), np.zeros((2, 2))))

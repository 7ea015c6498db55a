"""HDF5 files that state or unpack to more than they hold, and what others write rightly."""

from __future__ import annotations

import re
import struct
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.netcdf_file import limited_hdf5
from optopad.sims.readings.dataset import read_data, save_data
from optopad.sims.readings.recording import read_recording
from tests.sims.readings.test_dataset import made_up

MOST = 2_000_000


def opened(file: Path, most_bytes: float = MOST) -> list[str]:
    with limited_hdf5(file, most_bytes=most_bytes) as stream, h5py.File(stream, "r") as held:
        return list(held)


def peak_bytes() -> int:
    return 1024 * int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1])


def with_driver_block_of_a_gigabyte(file: Path) -> None:
    """The superblock names a block of the library's driver, at a place where its size reads as 1 to 2 GB."""
    save_data(made_up(), file)
    content = bytearray(file.read_bytes())
    at = next(
        at
        for at in range(100, len(content))
        if not content[at] and 1e9 < struct.unpack_from("<I", content, at + 4)[0] < 2e9
    )
    struct.pack_into("<Q", content, 48, at)
    file.write_bytes(content)


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
def test_a_header_that_states_a_gigabyte_takes_no_memory(tmp_path):
    file = tmp_path / "a.nc"
    read_data(save_data(made_up(), file))  # imports
    with_driver_block_of_a_gigabyte(file)
    Path("/proc/self/clear_refs").write_text("5")
    before = peak_bytes()
    for read in (read_data, read_recording):
        with pytest.raises(InputError, match="the file ends after"):
            read(file)
    assert peak_bytes() - before < 50_000_000


def chunked(held: h5py.File, filters: int, content: bytes) -> None:
    """An array of one chunk, packed by deflate as often as stated, with the given packed content."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((1_000,))
    for _ in range(filters):
        plan.set_deflate(4)
    space = h5py.h5s.create_simple((1_000,))
    array = h5py.h5d.create(held.id, b"a", h5py.h5t.NATIVE_DOUBLE, space, plan)
    array.write_direct_chunk((0,), content)


@pytest.mark.parametrize(
    ("filters", "content", "said"),
    [
        (2, zlib.compress(zlib.compress(bytes(8_000))), "packed more than once"),
        (1, zlib.compress(bytes(8_000_000)), "8000 bytes"),
        (1, bytes(20_000), "a chunk of 20000 bytes that states 8000"),
    ],
)
def test_chunks_that_unpack_to_more_than_they_state_are_refused(tmp_path, filters, content, said):
    with h5py.File(tmp_path / "a.nc", "w") as held:
        chunked(held, filters, content)
    with pytest.raises(ValueError, match=said):
        opened(tmp_path / "a.nc")


def write_large(held: h5py.File) -> None:
    held.create_dataset("a", shape=(10**6,), dtype="f8", chunks=(1_000,), compression="gzip")


def write_large_chunk(held: h5py.File) -> None:
    held.create_dataset("a", shape=(1,), maxshape=(None,), dtype="f8", chunks=(10**6,), compression="gzip")


def write_texts(held: h5py.File) -> None:
    held.create_dataset("a", data=["x" * 1_000_000] * 11, dtype=h5py.string_dtype())


def write_many_texts(held: h5py.File) -> None:
    held.create_dataset("a", data=["x"] * 20_000, dtype=h5py.string_dtype())


def write_attribute(held: h5py.File) -> None:
    held.create_dataset("a", data=1.0).attrs["b"] = ["x" * 1_000] * 50


def write_link(held: h5py.File) -> None:
    held["a"] = h5py.ExternalLink("other.h5", "/a")


def write_other_file(held: h5py.File) -> None:
    held.create_dataset("a", shape=(10,), dtype="f8", external="other.bin")


def write_virtual(held: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(10,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "a", shape=(10,))
    held.create_virtual_dataset("a", layout)


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (write_large, "unpacks to"),
        (write_large_chunk, "unpacks to"),
        (write_texts, "texts of more than"),
        (write_many_texts, "20000 texts"),
        (write_attribute, "an attribute of 50 entries"),
        (write_link, "refers to another file"),
        (write_other_file, "in other files"),
        (write_virtual, "in other files"),
    ],
)
def test_files_that_take_much_memory_or_lead_to_others_are_refused(tmp_path, write, said):
    with h5py.File(tmp_path / "a.nc", "w") as held:
        write(held)
    with pytest.raises(ValueError, match=said):
        opened(tmp_path / "a.nc")


def test_what_others_pack_is_read(tmp_path):
    values = np.arange(2_000)
    with h5py.File(tmp_path / "a.nc", "w") as held:
        held.create_dataset("plain", data=values)
        held.create_dataset("empty", data=h5py.Empty("f8"))
        held.create_dataset("text", data=["E1", "E2"], dtype=h5py.string_dtype())
        held.create_dataset("noise", data=np.random.default_rng(1).bytes(9_000), dtype="S9000")
        for name, packed in (
            ("deflate", {"compression": "gzip", "shuffle": True, "fletcher32": True}),
            ("lzf", {"compression": "lzf"}),
            ("scaled", {"scaleoffset": 0}),
        ):
            held.create_dataset(name, data=values, chunks=(100,), **packed)
        held["text"].attrs["names"] = ["a", "b"]
    assert len(opened(tmp_path / "a.nc")) == 7

"""Rows of light on disk: they come back whole or not at all, whatever happens to the file or beside it."""

from __future__ import annotations

import errno
import multiprocessing
import os
import sqlite3
from pathlib import Path

import pytest

from optopad.design.errors import InputError
from optopad.sims import cache as light_store_module
from optopad.sims.cache import SIZE_VARIABLE, GatheredLight, LightStore, light_store

ROWS = {bytes([k]) * 20: bytes(range(k, k + 64)) for k in range(100)}


@pytest.fixture
def store(tmp_path: Path) -> LightStore:
    return LightStore(tmp_path / "light" / "rows.sqlite", 10.0)


def test_rows_come_back_as_they_were(store: LightStore) -> None:
    store.write(ROWS)
    assert store.read(list(ROWS)) == ROWS
    assert store.read([b"unknown"]) == {}
    assert store.rows() == len(ROWS)


def test_reading_makes_no_file(store: LightStore) -> None:
    assert store.read(list(ROWS)) == {}
    assert store.rows() == 0
    assert not store.path.parent.exists()


def test_a_row_with_a_flipped_bit_is_absent_and_the_others_are_not(store: LightStore) -> None:
    store.write(ROWS)
    name, content = next(iter(ROWS.items()))
    file = sqlite3.connect(store.path)
    (sealed,) = file.execute("SELECT content FROM light WHERE name = ?", (name,)).fetchone()
    file.execute("UPDATE light SET content = ? WHERE name = ?", (bytes([*sealed[:-1], sealed[-1] ^ 1]), name))
    file.commit()
    file.close()
    found = store.read(list(ROWS))
    assert name not in found
    assert len(found) == len(ROWS) - 1
    store.write({name: content})
    assert store.read(list(ROWS)) == ROWS


def test_a_row_under_another_row_s_name_is_absent(store: LightStore) -> None:
    store.write(ROWS)
    one, other = list(ROWS)[:2]
    file = sqlite3.connect(store.path)
    file.execute(
        "UPDATE light SET content = (SELECT content FROM light WHERE name = ?) WHERE name = ?", (other, one)
    )
    file.commit()
    file.close()
    assert one not in store.read([one])


@pytest.mark.parametrize("keep", [0, 1, 50, 3000, -100])
def test_a_cut_file_is_begun_anew(store: LightStore, keep: int) -> None:
    store.write(ROWS)
    whole = store.path.read_bytes()
    store.path.write_bytes(whole[:keep])
    assert store.read(list(ROWS)).items() <= ROWS.items()
    store.write(ROWS)
    store.write(ROWS)  # the first may have found the damage, and removed the file
    assert store.read(list(ROWS)) == ROWS


@pytest.mark.parametrize("step", [101, 257])
def test_no_flipped_byte_gives_a_wrong_row_or_an_error(store: LightStore, step: int) -> None:
    store.write(ROWS)
    whole = store.path.read_bytes()
    for place in range(0, len(whole), step):
        store.path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        assert store.read(list(ROWS)).items() <= ROWS.items()


def test_a_file_that_is_no_database_is_begun_anew(store: LightStore) -> None:
    store.path.parent.mkdir()
    store.path.write_text("no database " * 100)
    assert store.read(list(ROWS)) == {}
    store.write(ROWS)
    assert store.read(list(ROWS)) == ROWS


def test_a_folder_that_cannot_be_made_costs_the_rows_and_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    store = LightStore(tmp_path / "file" / "rows.sqlite", 10.0)
    store.write(ROWS)
    assert store.read(list(ROWS)) == {}


def test_the_oldest_rows_go_when_the_file_is_full(tmp_path: Path) -> None:
    store = LightStore(tmp_path / "rows.sqlite", 1.0)
    sizes = []
    for batch in range(40):  # 100 kB each
        store.write({f"{batch}-{k}".encode(): bytes(10_000) for k in range(10)})
        sizes.append(store.path.stat().st_size)
    assert max(sizes) < 1.4e6  # a batch beyond the limit, and a tenth for SQLite's own pages
    assert store.read([b"0-0"]) == {}
    newest = [f"39-{k}".encode() for k in range(10)]
    assert len(store.read(newest)) == 10
    assert 40 <= store.rows() <= 110


def written_by(number: int, path: str) -> None:
    store = LightStore(Path(path), 10.0)
    for k in range(50):
        store.write({f"{number}-{k}".encode(): f"light of {number}, {k}".encode()})
        store.write({b"shared": b"the same from all"})


def test_processes_that_write_at_once_lose_nothing(store: LightStore) -> None:
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=written_by, args=(number, str(store.path))) for number in range(2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0, 0]
    names = [f"{number}-{k}".encode() for number in range(2) for k in range(50)]
    assert len(store.read([*names, b"shared"])) == 101


def test_a_locked_file_is_left_alone(store: LightStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optopad.sims.cache.PATIENCE_S", 0.05)
    store.write(ROWS)
    other = sqlite3.connect(store.path, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    assert store.read(list(ROWS)) == {}
    store.write({b"new": b"row"})
    other.execute("ROLLBACK")
    other.close()
    assert store.read([*ROWS, b"new"]) == ROWS


def test_the_variable_sets_the_size_and_0_turns_the_store_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv(SIZE_VARIABLE, "12.5")
    assert light_store() == LightStore(tmp_path / "light" / "rows.sqlite", 12.5)
    monkeypatch.delenv(SIZE_VARIABLE)
    chosen = light_store()
    assert chosen is not None
    assert chosen.size_mb == 500.0
    monkeypatch.setenv(SIZE_VARIABLE, "0")
    assert light_store() is None


@pytest.mark.parametrize("text", ["plenty", "-1", "nan", "inf"])
def test_a_size_that_is_none_is_refused_by_name(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(SIZE_VARIABLE, text)
    with pytest.raises(InputError, match=f"OPTOPAD_LIGHT_CACHE_MB: '{text}' is refused.*megabytes.*or 0"):
        light_store()


def test_gathered_rows_are_known_at_once_and_written_in_time(
    store: LightStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    (first, content), (second, other), *_ = ROWS.items()
    store.write({second: other})
    gathered = GatheredLight(store)
    gathered.write({first: content})
    assert gathered.read([first, second, b"unknown"]) == {first: content, second: other}
    assert store.read([first]) == {}
    monkeypatch.setattr(light_store_module, "WRITTEN_EVERY_S", 0.0)
    gathered.write({b"third": b"light"})
    assert store.read([first, b"third"]) == {first: content, b"third": b"light"}
    monkeypatch.undo()
    gathered.write({b"fourth": b"light"})
    gathered.put_away()
    assert store.read([b"fourth"]) == {b"fourth": b"light"}


def test_a_file_that_is_write_protected_is_read_and_stays(
    store: LightStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.write(ROWS)
    opened = sqlite3.connect

    def protected(path: Path, timeout: float) -> sqlite3.Connection:
        return opened(f"file:{path}?mode=ro", timeout=timeout, uri=True)

    monkeypatch.setattr(sqlite3, "connect", protected)
    monkeypatch.setattr(os, "access", lambda *_: False)
    store.write({b"new": b"row"})
    assert store.read([*ROWS, b"new"]) == ROWS


def test_a_row_too_long_for_light_is_not_taken_into_memory(
    store: LightStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.write(ROWS | {b"long": bytes(1000)})
    monkeypatch.setattr("optopad.sims.cache.MOST_ROW_BYTES", 500)
    assert store.read([*ROWS, b"long"]) == ROWS


def test_a_folder_that_may_not_be_looked_into_holds_no_light(
    store: LightStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "stat", refuse)
    monkeypatch.setattr(Path, "mkdir", refuse)
    store.write(ROWS)
    assert store.read(list(ROWS)) == {}
    assert store.rows() == 0


def test_a_flipped_byte_in_the_header_is_mended_by_the_next_writes(store: LightStore) -> None:
    store.write(ROWS)
    whole = store.path.read_bytes()
    dead = []
    for place in range(200):
        store.path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        for _ in range(2):  # the first may find the damage, and remove the file
            store.write({b"new": b"row"})
        if store.read([b"new"]) != {b"new": b"row"}:
            dead.append(place)
    assert dead == []

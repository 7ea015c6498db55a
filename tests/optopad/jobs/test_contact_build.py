"""`optopad contact build`: the file, the comparison with the shipped library, and bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.cli import main
from optopad.sims.contact.library import build as library_build
from optopad.sims.contact.library.profile_library import pack, shipped_library


@pytest.fixture
def made(monkeypatch):
    """The solves replaced by the shipped library, 1 % stiffer; the real ones take an hour or two."""
    shipped = shipped_library()
    stiffer = shipped.coefficients.copy()
    stiffer[:, :, 0] += np.log(1.01)
    called = []

    def build(workers, on_step=None):
        called.append(workers)
        if on_step is not None:
            on_step(1, 1)
        return replace(shipped, coefficients=stiffer)

    monkeypatch.setattr(library_build, "build_library", build)
    return called


def test_build_writes_the_library_and_compares_it_with_the_shipped_one(tmp_path, capsys, made):
    out = tmp_path / "new" / "profiles.npz"
    assert main(["contact", "build", "--out", str(out), "--workers", "3"]) == 0
    printed = capsys.readouterr()
    assert made == [3]
    assert "solved    1 of 1" in printed.err
    assert "force within 1 %" in printed.out
    held = np.load(out, allow_pickle=False)
    assert set(held) == set(pack(shipped_library()))
    assert held["coefficients"][0, 0, 0] == pytest.approx(
        shipped_library().coefficients[0, 0, 0] + np.log(1.01), rel=1e-6
    )


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_solved(tmp_path, capsys, made):
    (tmp_path / "file").write_text("")
    assert main(["contact", "build", "--out", str(tmp_path / "file" / "p.npz")]) == 2
    assert "choose another --out" in capsys.readouterr().err
    assert main(["contact", "build", "--out", str(tmp_path)]) == 2
    assert made == []


def test_no_workers_are_refused(tmp_path, capsys, made):
    assert main(["contact", "build", "--out", str(tmp_path / "p.npz"), "--workers", "0"]) == 2
    assert made == []

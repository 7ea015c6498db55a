"""A load cell's log: every unit is read or named, and wrong samples are counted or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.force_log import ForceLog, read_force_log
from optopad.fabrication.driver.recording.position_log import read_position_log
from tests.said import pattern

BEGINS_S = np.array([2.0, 7.5, 14.0, 19.0, 25.5, 31.0, 38.0, 43.0])
HELD_S, TOP_N, TARE_N = 3.0, 20.0, 0.3


def pressed(rate_hz: float, *, jitter: float = 0.0, noise_n: float = 0.005) -> ForceLog:
    """Eight presses of growing force, each with ramps of 0.3 s, on a tare."""
    rng = np.random.default_rng(1)
    time_s = np.arange(0.0, 50.0, 1.0 / rate_hz)
    time_s = time_s + jitter / rate_hz * rng.uniform(-0.5, 0.5, len(time_s))
    force_n = np.full(len(time_s), TARE_N)
    for begin, top in zip(BEGINS_S, np.linspace(0.2, 1.0, len(BEGINS_S)) * TOP_N, strict=True):
        ramps = [begin - 0.15, begin + 0.15, begin + HELD_S - 0.15, begin + HELD_S + 0.15]
        force_n += np.interp(time_s, ramps, [0.0, top, 0.9 * top, 0.0])
    return ForceLog(file="cell", time_s=time_s, force_n=force_n + noise_n * rng.standard_normal(len(time_s)))


def written(folder: Path, rows: list[str], heading: str = "time_s,force_n") -> Path:
    file = folder / "cell.csv"
    file.write_text("\n".join([heading, *rows]) + "\n")
    return file


def rows_of(log: ForceLog, scale: float = 1.0) -> list[str]:
    return [f"{at:.4f},{scale * force:.8g}" for at, force in zip(log.time_s, log.force_n, strict=True)]


LOG = pressed(25.0)
ROWS = rows_of(LOG)


@pytest.mark.parametrize(
    ("name", "newtons"),
    [
        ("Force (N)", 1.0), ("F_N", 1.0), ("N", 1.0), ("Load [newtons]", 1.0), ("fz/N", 1.0), ("force_mN", 1e-3),
        ("force_cN", 1e-2), ("Kraft (kN)", 1e3), ("force_gf", 9.80665e-3), ("load_kgf", 9.80665),
        ("force_lbf", 4.4482216), ("force_ozf", 0.27801385),
    ],
)  # fmt: skip
def test_a_force_in_any_unit_is_read_in_newtons(name: str, newtons: float, tmp_path: Path) -> None:
    found = read_force_log(written(tmp_path, rows_of(LOG, 1.0 / newtons), f"Time (s),{name}"))
    assert found.force_n == pytest.approx(LOG.force_n, rel=1e-6, abs=1e-6)
    assert len(found.notes) == (newtons != 1.0)
    assert all(f"multiplied by {newtons:g}," in note for note in found.notes)


@pytest.mark.parametrize(
    ("heading", "told"),
    [
        ("time_s,force_kg", "9.80665 ... force_n ... force_kgf"),
        ("time_s,Load [g]", "load_g ... 0.00980665 ... force_gf"),
        ("time_s,weight_lbs", "weight_lb ... 4.44822 ... force_lbf"),
        ("time_s,weight", "time_s ... force_n, or force_gf"),
        ("n,force", "has no time"),
        ("time_s,n,weight", "has no force_n"),  # n counts the samples
        ("time_s,fx_N,fz_N", "fx_n, fz_n ... force_n"),
        ("host_time_s,device_time_s,force_n", "has the times host_time_s, device_time_s; name the one"),
    ],
)
def test_a_column_that_leaves_its_unit_open_is_refused_with_the_name_to_give(
    heading: str, told: str, tmp_path: Path
) -> None:
    rows = [",".join([row, "1"][: heading.count(",")]) for row in ROWS[:20]]
    with pytest.raises(InputError, match=pattern(told)):
        read_force_log(written(tmp_path, rows, heading))


@pytest.mark.parametrize(
    ("name", "tick_s"), [("time [ms]", 1e-3), ("millis", 1e-3), ("micros", 1e-6), ("Elapsed time (sec)", 1.0),
                         ("timestamp_ms", 1e-3)]
)  # fmt: skip
def test_a_time_in_any_spelling_is_read_in_seconds(name: str, tick_s: float, tmp_path: Path) -> None:
    rows = [f"{at / tick_s:.0f},{force},1,1" for at, force in enumerate([0] * 4 + [4] * 5)]
    heading = f"{name},force_n,Y (mm),Depth/\N{MICRO SIGN}m"
    assert read_force_log(written(tmp_path, rows, heading)).time_s == pytest.approx(range(9))
    stage = read_position_log(written(tmp_path, rows, heading.replace("force_n", "X (cm)")))
    assert stage.time_s == pytest.approx(range(9))
    assert stage.press_mm[4] == pytest.approx([40.0, 1.0, 0.001])


def test_few_wrong_samples_are_left_out_and_counted_each_kind_by_its_row(tmp_path: Path) -> None:
    rows = [*ROWS]
    for k, force in ((100, "-143.0"), (400, "1302.0"), (401, "1302.0"), (10, "9.0"), (700, "nan"), (701, "")):
        rows[k] = f"{rows[k].partition(',')[0]},{force}"
    rows.insert(51, rows[50])
    file = written(tmp_path, ["Tare done", "time_s,force_n", *rows], heading="HX711 ready")
    found = read_force_log(file)
    assert found.left_out == 7
    kept = np.delete(np.arange(len(ROWS)), [10, 100, 400, 401, 700, 701])
    assert found.force_n == pytest.approx(LOG.force_n[kept], abs=1e-6)
    assert found.time_s == pytest.approx(LOG.time_s[kept], abs=1e-4)
    doubled, missing, spikes = found.notes
    assert "row 55 " in doubled
    assert "2 rows, first row 705," in missing
    assert "4 rows, first row 14," in spikes
    assert "25 samples per second" in spikes


def test_many_wrong_samples_are_refused_with_the_first_row(tmp_path: Path) -> None:
    for wrong, told in (("-1.0", r"a spike at 25 samples per second in 20 of 1250 rows, first in row 12 "),
                        ("nan", "no number in 20 of 1250 rows, first in row 12 ")):  # fmt: skip
        rows = [f"{row.partition(',')[0]},{wrong}" if k % 62 == 10 else row for k, row in enumerate(ROWS)]
        with pytest.raises(InputError, match=told):
            read_force_log(written(tmp_path, rows[:1250]))


def test_no_honest_sample_is_a_spike(tmp_path: Path) -> None:
    for log in (LOG, pressed(5.0), pressed(80.0, jitter=0.8), pressed(10.0, noise_n=0.3)):
        assert read_force_log(written(tmp_path, rows_of(log))).left_out == 0
    taps = np.tile([0.3, 0.3, 0.3, 0.3, 5.0, 20.0, 5.0, 0.3], 30)  # without a hold, at 10 Hz
    log = ForceLog(file="taps", time_s=0.1 * np.arange(len(taps)), force_n=taps)
    assert read_force_log(written(tmp_path, rows_of(log))).left_out == 0


def test_rows_that_contradict_and_a_logger_that_starts_anew_are_refused_by_row(tmp_path: Path) -> None:
    at = ROWS[50].partition(",")[0]
    with pytest.raises(InputError, match=r"53 has.*row 52"):
        read_force_log(written(tmp_path, [*ROWS[:51], f"{at},7.5", *ROWS[51:]]))
    with pytest.raises(InputError, match=r"row 102 is -3\.960 s after row 101; .* two logs"):
        read_force_log(written(tmp_path, [*ROWS[:100], *ROWS[:100]]))
    torn = written(tmp_path, [*ROWS[:50], "2.0"])
    torn.write_text(torn.read_text().removesuffix("\n"))  # the logger lost its power
    with pytest.raises(InputError, match=r"52 has.*1 values"):
        read_force_log(torn)
    with pytest.raises(InputError, match="row 1 has"):
        read_force_log(written(tmp_path, ROWS[1:], ROWS[0]))
    for unit, step in (("ms", 100), ("us", 10**5)):
        ticks = [(2**32 + step * k) % 2**32 for k in range(-5, 5)]  # the counter wraps
        found = read_force_log(written(tmp_path, [f"{one},1" for one in ticks], f"time_{unit},force_n"))
        assert np.diff(found.time_s) == pytest.approx([0.1] * 9, rel=0.01)
        ticks[:5] = [int(2.4e9) + k for k in range(5)]  # 40 minutes of microseconds: a reset, no wrap
        with pytest.raises(InputError, match="row 7 is"):
            read_force_log(written(tmp_path, [f"{one},1" for one in ticks], f"time_{unit},force_n"))


@pytest.mark.parametrize(
    ("forces", "told"),
    [
        (["nan"] * 3, "0 forces ... 3 rows ... 8 at"),
        (["nan", "nan", "nan", "1.0"], "has 1 forces in 4 rows, needs 8"),
        ([str(0.1 * (k % 3)) for k in range(7)], "has 7 forces in 7 rows, needs 8"),
        (["0.1", "0.2", "0.1", "0.2", "0.1", "0.2", "0.1", "90.0"], "has 7 forces in 8 rows, needs 8"),
    ],
)
def test_a_log_with_few_samples_is_refused(forces: list[str], told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=pattern(told)):
        read_force_log(written(tmp_path, [f"{k},{force}" for k, force in enumerate(forces)]))

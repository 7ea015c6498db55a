"""Labels of data from anywhere: units are converted, contradictions are refused by every reader, genuine data pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.design.preset import PRESETS, preset
from optopad.sims.readings.dataset import PressData, data_notes, read_data, save_data
from optopad.sims.readings.label_checks import require_true_labels
from optopad.sims.readings.recording import read_recording
from tests.said import pattern
from tests.sims.learning.pressed_pad import field_counts, grid_mm, made_up_data

PAD = preset("piacenza2017-pad")
GOOD = replace(made_up_data(grid_mm(3)), design_digest=PAD.digest)
MESSAGES = {
    "upwards": "depth positive",
    "from the middle": "outside the cavity, .*origin",
    "micrometres": "reach from -4000 to 5000 mm, .* are they in millimetres",
    "metres": "millimetres, or in metres",
}


def mislabelled(press_mm: np.ndarray, how: str) -> np.ndarray:
    turned, moved = np.array([1.0, 1.0, -1.0]), np.array([16.0, 16.0, 0.0])
    return {
        "upwards": press_mm * turned,
        "from the middle": press_mm - moved,
        "micrometres": press_mm * 1e3,
        "metres": press_mm / 1e3,
    }[how]


def read_netcdf_data(data: PressData, folder: Path) -> np.ndarray:
    return read_data(save_data(data, folder / "a.nc")).press_mm


def read_netcdf_recording(data: PressData, folder: Path) -> np.ndarray:
    found = read_recording(save_data(data, folder / "a.nc"))
    return np.column_stack([found.place_mm, found.depth_mm])


def read_csv_recording(data: PressData, folder: Path) -> np.ndarray:
    table = np.column_stack([data.press_mm, data.features()])
    digest = "" if data.design_digest is None else f"# design_digest: {data.design_digest}\n"
    heading = ",".join(["x_mm", "y_mm", "depth_mm", *data.pair_names])
    rows = "\n".join(",".join(f"{value:.6g}" for value in row) for row in table)
    (folder / "a.csv").write_text(f"{digest}{heading}\n{rows}\n", encoding="utf-8")
    found = read_recording(folder / "a.csv")
    return np.column_stack([found.place_mm, found.depth_mm])


READERS = (read_netcdf_data, read_netcdf_recording, read_csv_recording)


@pytest.mark.parametrize("digest", [PAD.digest, None])
@pytest.mark.parametrize("read", READERS)
def test_every_reader_refuses_labels_that_contradict_the_pad_and_takes_true_ones(
    read: Callable[[PressData, Path], np.ndarray], digest: str | None, tmp_path: Path
) -> None:
    data = replace(GOOD, design_digest=digest)
    assert read(data, tmp_path) == pytest.approx(data.press_mm)
    for how, message in MESSAGES.items():
        with pytest.raises(InputError, match=rf"a\.(nc|csv): .*{message}"):
            read(replace(data, press_mm=mislabelled(data.press_mm, how)), tmp_path)


@pytest.mark.parametrize(
    ("verb", "how"),
    [
        (["train", "a.nc"], "upwards"),
        (["evaluate", "a.nc", "--model", "absent.optomodel"], "from the middle"),
        (["calibrate", PAD.name, "a.nc"], "micrometres"),
        (["compare", PAD.name, "a.nc"], "metres"),
    ],
)
def test_every_verb_of_data_refuses_them_in_one_line_and_writes_nothing(
    verb: list[str],
    how: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    save_data(replace(GOOD, press_mm=mislabelled(GOOD.press_mm, how)), tmp_path / "a.nc")
    assert main(verb) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "a.nc: press_" in said.err
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["a.nc"]


def two_tips(other_mm: list[float], press_mm: list[float] | None = None) -> PressData:
    """The good data, with another tip in the last frames, in which the first one is at `press_mm`."""
    others, press = np.full((len(GOOD), 1, 3), np.nan), GOOD.press_mm.copy()
    others[-20:, 0] = other_mm
    press[-20:] = press_mm or [10.0, 10.0, 1.0]
    return replace(GOOD, press_mm=press, others_mm=others)


@pytest.mark.parametrize(
    ("other_mm", "said"),
    [
        (
            [14.0, 10.0, 1.0],
            "20 of 20 frames ... overlap ... (10, 10) and (14, 10) mm, their centres 4.00 mm ... two tip radii, 6 mm",
        ),
        ([40.0, 10.0, 1.0], "others: 20 of 40 ... outside the cavity ... (40, 10)"),
        ([20.0, 10.0, 1000.0], "others: ... 1000 mm ... millimetres"),
        ([-999.0, -999.0, -999.0], "others 1, x: 20 of ... -999"),
    ],
)
def test_further_tips_that_cannot_be_are_refused(other_mm: list[float], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=pattern(said)):
        read_data(save_data(two_tips(other_mm), tmp_path / "a.nc"))


def test_a_tip_that_is_lifted_may_be_anywhere_and_depths_of_two_touches_have_any_signals(
    tmp_path: Path,
) -> None:
    lifted = two_tips([12.0, 10.0, -3.0])
    assert not read_data(save_data(lifted, tmp_path / "a.nc")).has_more.any()
    turned = two_tips(
        [20.0, 10.0, 1.0], [10.0, 10.0, -4.0]
    )  # the first is lifted, the signals are those of the other
    assert read_data(save_data(turned, tmp_path / "b.nc")).has_more.sum() == 20
    unknown = replace(two_tips([12.0, 10.0, 1.0]), design_digest=None)  # of any radius
    assert read_data(save_data(unknown, tmp_path / "c.nc")).touch_count.max() == 2


@pytest.mark.parametrize("name", PRESETS)
def test_locations_are_held_against_the_outline_of_the_design(name: str) -> None:
    design = preset(name)
    x_mm, y_mm = design.cavity.length_mm, design.cavity.width_mm
    middle, corner = np.array([[x_mm / 2, y_mm / 2]]), np.array([[x_mm - 0.1, y_mm - 0.1]])
    depth, signals = np.ones(1), np.ones((1, 3))
    require_true_labels(depth, middle, signals, design)
    require_true_labels(-depth, 10 * corner, signals, design)  # a tip that travels
    if design.cavity.outline == "rectangle":
        require_true_labels(depth, corner, signals, design)
        corner = corner + np.array([1.0, 0.0])
    with pytest.raises(InputError, match="1 of 1"):
        require_true_labels(depth, corner, signals, design)


def hovering(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """No touch at all, and a drift of 5 % in a single approach."""
    depth = np.linspace(-5.0, 0.0, 200)
    return depth, 1.0 + 0.05 * np.linspace(0.0, 1.0, 200)


def few_light_touches(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Three light touches after a long hover, and drift of 3 %."""
    depth = np.concatenate([rng.uniform(-10.0, 0.0, 400), [0.02, 0.05, 0.1]])
    return depth, 1.0 + 0.03 * np.linspace(-1.0, 1.0, 403)


def very_noisy(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A tenth of the signal is noise, in few readings."""
    depth = np.linspace(-2.0, 3.0, 12)
    return depth, 1.0 + 0.1 * rng.normal(size=12)


def wild_frames(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One frame in ten is at full scale."""
    depth = np.tile(np.linspace(-4.0, 2.0, 60), 5)
    return depth, np.where(rng.random(300) < 0.1, 5.0, 1.0)


def surface_set_too_low(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The zero of the depth is 1 mm inside the pad."""
    return np.linspace(-4.0, 2.0, 61), np.ones(61)


def slow_gain(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The gain drifts by 30 % over many presses."""
    depth = np.tile(np.linspace(-3.0, 4.0, 50), 8)
    return depth, np.linspace(1.0, 1.3, 400)


def random_pokes(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Every sample is at a location and depth of its own."""
    return rng.uniform(-5.0, 5.0, 300), np.ones(300)


GENUINE = (hovering, few_light_touches, very_noisy, wild_frames, surface_set_too_low, slow_gain, random_pokes)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("made", GENUINE)
def test_genuine_data_pass_with_noise_drift_and_hovering(
    made: Callable[[np.random.Generator], tuple[np.ndarray, np.ndarray]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    depth, gain = made(rng)
    location = (
        rng.uniform(6.0, 26.0, (len(depth), 2)) if made is random_pokes else np.full((len(depth), 2), 16.0)
    )
    zero = 1.0 if made is surface_set_too_low else 0.0
    signals = field_counts(np.column_stack([location, depth + zero])).reshape(len(depth), -1) * gain[:, None]
    signals += rng.normal(0.0, 0.5, signals.shape)
    for design in (PAD, None):
        require_true_labels(depth, location, signals, design)


@pytest.mark.parametrize("made", [very_noisy, wild_frames, slow_gain, random_pokes])
def test_the_same_data_with_depth_upwards_are_refused(
    made: Callable[[np.random.Generator], tuple[np.ndarray, np.ndarray]],
) -> None:
    rng = np.random.default_rng(0)
    depth, gain = made(rng)
    location = (
        rng.uniform(6.0, 26.0, (len(depth), 2)) if made is random_pokes else np.full((len(depth), 2), 16.0)
    )
    signals = field_counts(np.column_stack([location, depth])).reshape(len(depth), -1) * gain[:, None]
    with pytest.raises(InputError, match="depth positive into"):
        require_true_labels(-depth, location, signals, PAD)


HELD: dict[int, tuple[PressData, xr.Dataset]] = {}
"""Data as a file holds them, by the identity of the data."""


def rewritten(data: PressData, folder: Path, units: dict[str, tuple[object, float]]) -> Path:
    """The file of data, with some variables in another unit: its name and how many of it are one of the usual."""
    if id(data) not in HELD:
        with xr.open_dataset(
            save_data(data, folder / "good.nc"), engine="h5netcdf", decode_times=False
        ) as held:
            HELD[id(data)] = (data, held.load())
    dataset = HELD[id(data)][1].copy()
    for name, (unit, factor) in units.items():
        dataset[name] = dataset[name] * factor
        dataset[name].attrs = {} if unit is None else {"units": unit}
    dataset.to_netcdf(
        folder / "a.nc", engine="h5netcdf", unlimited_dims=[]
    )  # which are read ten times as fast
    return folder / "a.nc"


LENGTHS = (
    ("mm", 1.0), ("um", 1e3), ("m", 1e-3), ("cm", 0.1), ("\u00b5m", 1e3), ("\u03bcm", 1e3), ("microns", 1e3),
    ("Millimeters", 1.0),
)  # fmt: skip
TRUE = replace(GOOD, true_press_mm=GOOD.press_mm + 0.01)


@pytest.mark.parametrize("first", range(0, len(LENGTHS), 3))
def test_lengths_are_converted_each_by_its_own_unit(first: int, tmp_path: Path) -> None:
    names = [f"{kind}_{axis}" for kind in ("press", "true") for axis in ("x", "y", "depth")]
    file = rewritten(
        TRUE, tmp_path, {name: LENGTHS[(first + k) % len(LENGTHS)] for k, name in enumerate(names)}
    )
    found, recorded = read_data(file), read_recording(file)
    assert found.press_mm == pytest.approx(TRUE.press_mm)
    assert found.true_press_mm == pytest.approx(TRUE.true_press_mm)
    assert recorded.place_mm == pytest.approx(TRUE.press_mm[:, :2])
    assert recorded.depth_mm == pytest.approx(TRUE.press_mm[:, 2])


@pytest.mark.parametrize(
    ("name", "units"),
    [("press_x", "inch"), ("press_depth", "ms-1"), ("true_x", 7), ("time_s", "inch"), ("counts", 7)],
)
def test_an_unknown_unit_is_refused_by_name(name: str, units: object, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=rf"a\.nc: {name}: the attribute units is {str(units)!r}, needs one of"
    ):
        read_data(rewritten(TRUE, tmp_path, {name: (units, 1.0)}))


@pytest.mark.parametrize(
    ("units", "factor"), [("ms", 1e3), ("seconds", 1.0), ("s since 1970", 1.0), ("min", 1 / 60)]
)
def test_times_are_converted(units: str, factor: float, tmp_path: Path) -> None:
    assert read_data(rewritten(GOOD, tmp_path, {"time_s": (units, factor)})).time_s == pytest.approx(
        GOOD.time_s
    )


@pytest.mark.parametrize(("units", "factor"), [("V", 1.0), ("volts", 1.0), ("mV", 1e3)])
def test_volts_are_converted_by_the_design_s_converter_or_refused(
    units: str, factor: float, tmp_path: Path
) -> None:
    per_count = 5.0 / 1024.0 * factor  # the converter has 10 bits, its reference is the supply of 5 V
    found = read_data(rewritten(GOOD, tmp_path, {"counts": (units, per_count)}))
    assert found.counts == pytest.approx(GOOD.counts, rel=1e-5)
    assert any("the readings were volts" in note for note in data_notes(found))
    nameless = rewritten(replace(GOOD, design_digest=None), tmp_path, {"counts": (units, per_count)})
    assert read_data(nameless, PAD).counts == pytest.approx(GOOD.counts, rel=1e-5)
    with pytest.raises(InputError, match=r"a\.nc: counts.*--design"):
        read_data(nameless)


@pytest.mark.parametrize("units", [None, "counts"])
def test_readings_that_are_volts_by_their_size_are_refused(units: str | None, tmp_path: Path) -> None:
    for design in (PAD, None):
        with pytest.raises(InputError, match="ADC counts"):
            read_data(rewritten(GOOD, tmp_path, {"counts": (units, 5.0 / 1024.0)}), design)
    read_data(rewritten(GOOD, tmp_path, {"counts": (units, 1.0)}))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("um", 1e3), ("m", 1e-3)])
def test_columns_of_a_csv_have_their_unit_in_their_name(unit: str, factor: float, tmp_path: Path) -> None:
    depth, file = np.array([-1.0, 0.0, 1.0, 2.0]), tmp_path / "a.csv"
    rows = [f"{value * factor},{16 * factor},{16 * factor},{800 - 90 * max(value, 0)}" for value in depth]
    file.write_text("\n".join([f"depth_{unit},x_{unit},y_{unit},signal", *rows]), encoding="utf-8")
    found = read_recording(file)
    assert found.depth_mm == pytest.approx(depth)
    assert found.place_mm == pytest.approx(np.full((4, 2), 16.0))
    file.write_text("\n".join(["depth_mm,depth_um,signal", "0,0,1", "1,1000,1"]), encoding="utf-8")
    with pytest.raises(InputError, match="has depth_mm and depth_um; keep one"):
        read_recording(file)

"""Recordings: what is read, what is refused, and a measured press over the simulated one."""

import json

import numpy as np
import pytest
import xarray as xr

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.sims.learning import recorded_press as laying
from optopad.sims.learning.recorded_press import recorded_press
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.recording import read_recording
from tests.said import pattern
from tests.sims.made_up_scores import made_up_pair

PAIR = preset("piacenza2017-pair")
DEPTH_MM = np.concatenate([[-1.0, -0.5, 0.0], depth_schedule_mm(5.0)[1:], np.arange(4.5, -1.0, -0.5)])
MADE_UP = made_up_pair("E2-R2")


@pytest.fixture
def simulated(monkeypatch):
    """The made-up pair in place of the light model."""
    from dataclasses import replace

    monkeypatch.setattr(
        laying,
        "_simulated",
        lambda _design, _place, pairs, _seed: (replace(MADE_UP, name="E2-R2"),) * len(pairs),
    )


def ratio_at(depth_mm):
    curves = MADE_UP.curves
    return np.interp(depth_mm, curves.depth_mm, curves.total / curves.total[0])


def csv_of(tmp_path, columns, comment=""):
    lines = [",".join(columns)] + [
        ",".join(f"{value:.6f}" for value in row) for row in zip(*columns.values(), strict=True)
    ]
    file = tmp_path / "press.csv"
    file.write_text(comment + "\n".join(lines) + "\n", encoding="utf-8")
    return file


def netcdf_of(tmp_path, *, digest=PAIR.digest, dark=7.0, place=(10.0, 10.0), drop=(), depth_mm=DEPTH_MM):
    counts = np.full((len(depth_mm), 4, 3), 50.0) + dark
    counts[:, 1, 1] = 800.0 * ratio_at(depth_mm) + dark
    counts[:, 3, :] = dark
    time = np.arange(len(depth_mm))
    dataset = xr.Dataset(
        {
            "counts": (("time", "state", "receiver"), counts, {"units": "count"}),
            "press_depth": ("time", depth_mm, {"units": "mm"}),
            "press_x": ("time", np.full(len(time), place[0])),
            "press_y": ("time", np.full(len(time), place[1])),
        },
        coords={"state": ["E1", "E2", "E3", "off"], "receiver": ["R1", "R2", "R3"]},
        attrs={"design_digest": digest},
    ).drop_vars(list(drop))
    dataset.to_netcdf(tmp_path / "press.nc", engine="h5netcdf")
    return tmp_path / "press.nc"


def test_a_recording_of_the_simulated_curve_is_no_distance_from_it(simulated, tmp_path):
    found = recorded_press(PAIR, read_recording(netcdf_of(tmp_path)), pairs=("E2-R2",))
    pair = found.pairs[0]
    assert pair.rms == pytest.approx(0.0, abs=1e-12)  # the same numbers, dark readings subtracted
    assert pair.untouched_counts == pytest.approx(800.0)
    assert found.place_mm == (10.0, 10.0)
    assert any("off state" in note for note in found.notes)


def test_readings_apart_by_a_hundredth_are_told_so(simulated, tmp_path):
    signal = 1000.0 * (ratio_at(DEPTH_MM) + np.where(DEPTH_MM > 0, 0.01, 0.0))
    found = recorded_press(PAIR, read_recording(csv_of(tmp_path, {"depth_mm": DEPTH_MM, "signal": signal})))
    assert found.pairs[0].worst == pytest.approx(0.01, abs=1e-6)
    assert any("names no design" in note for note in found.notes)
    assert any("no location" in note for note in found.notes)


def test_only_the_press_is_compared_and_the_retraction_is_kept(simulated, tmp_path):
    signal = 1000.0 * ratio_at(DEPTH_MM)
    signal[DEPTH_MM.argmax() + 1 :] *= 0.9  # a hysteresis of 10 %
    found = recorded_press(
        PAIR, read_recording(csv_of(tmp_path, {"depth_mm": DEPTH_MM, "E2-R2": signal}))
    ).pairs[0]
    assert found.rms == pytest.approx(0.0, abs=1e-6)
    assert len(found.ratio) == len(DEPTH_MM)
    assert found.deepest == DEPTH_MM.argmax()


def test_a_recording_of_another_design_is_refused_by_its_digest(tmp_path):
    with pytest.raises(InputError, match=r"of another design \(digest 00000000, not cfa40125\)"):
        recorded_press(PAIR, read_recording(netcdf_of(tmp_path, digest="0" * 64)))
    named = csv_of(tmp_path, {"depth_mm": DEPTH_MM, "signal": DEPTH_MM + 9}, f"# design_digest: {'0' * 64}\n")
    with pytest.raises(InputError, match="of another design"):
        recorded_press(PAIR, read_recording(named))


@pytest.mark.parametrize("said", ["0c3a4f54", "0C3A4F54" + "0" * 56, "0" * 64])
def test_a_csv_of_another_design_is_refused_by_any_form_of_its_digest(simulated, tmp_path, said):
    file = csv_of(tmp_path, {"depth_mm": DEPTH_MM, "E2-R2": ratio_at(DEPTH_MM)}, f"# design_digest: {said}\n")
    with pytest.raises(InputError, match="another design"):
        recorded_press(PAIR, read_recording(file))


@pytest.mark.parametrize("said", [PAIR.digest, PAIR.digest[:8], PAIR.digest.upper()])
def test_a_csv_of_this_design_is_taken_by_any_form_of_its_digest(simulated, tmp_path, said):
    file = csv_of(tmp_path, {"depth_mm": DEPTH_MM, "E2-R2": ratio_at(DEPTH_MM)}, f"# design_digest: {said}\n")
    assert not any("names no design" in note for note in recorded_press(PAIR, read_recording(file)).notes)


@pytest.mark.parametrize("said", ["abc", "<64 digits>", "0c3a4f5"])
def test_a_csv_with_no_digest_for_a_digest_is_refused(tmp_path, said):
    file = csv_of(tmp_path, {"depth_mm": DEPTH_MM, "E2-R2": ratio_at(DEPTH_MM)}, f"# design_digest: {said}\n")
    with pytest.raises(InputError, match="no digest"):
        read_recording(file)


def test_a_csv_with_half_a_place_is_refused(tmp_path):
    columns = {"depth_mm": DEPTH_MM, "x_mm": np.full(len(DEPTH_MM), 6.0), "E2-R2": ratio_at(DEPTH_MM)}
    with pytest.raises(InputError, match="x_mm without y_mm"):
        read_recording(csv_of(tmp_path, columns))


def test_depths_in_another_unit_are_not_compared_at_the_surface_alone(simulated, tmp_path):
    kept = (DEPTH_MM <= 0.0) | (DEPTH_MM >= 1.0)
    columns = {"depth_mm": 10.0 * DEPTH_MM[kept], "E2-R2": ratio_at(DEPTH_MM[kept])}
    with pytest.raises(InputError, match="its depths reach from -10 to 50: are they in millimetres"):
        recorded_press(PAIR, read_recording(csv_of(tmp_path, columns)))


@pytest.mark.parametrize(
    ("digest", "words"), [("", "is no digest"), (7, "is no digest"), ("0" * 8, "another design")]
)
def test_a_netcdf_s_digest_is_held_to_the_same(simulated, tmp_path, digest, words):
    """An empty one begins every digest."""
    with pytest.raises(InputError, match=words):
        recorded_press(PAIR, read_recording(netcdf_of(tmp_path, digest=digest)))


def test_a_netcdf_with_half_a_place_is_refused(tmp_path):
    with pytest.raises(InputError, match="press_x without press_y"):
        read_recording(netcdf_of(tmp_path, drop=("press_y",)))


def test_several_places_need_one_that_is_named(simulated, tmp_path):
    twice = np.concatenate([DEPTH_MM, DEPTH_MM])
    x_mm = np.repeat([10.0, 12.0], len(DEPTH_MM))
    columns = {
        "depth_mm": twice,
        "x_mm": x_mm,
        "y_mm": np.full_like(x_mm, 10.0),
        "E2-R2": 900 * ratio_at(twice),
    }
    recording = read_recording(csv_of(tmp_path, columns))
    with pytest.raises(InputError, match=r"2 locations.*--at X,Y.*--at 10,10"):
        recorded_press(PAIR, recording)
    assert len(recorded_press(PAIR, recording, at_mm=(12.0, 10.0)).pairs[0].ratio) == len(DEPTH_MM)
    with pytest.raises(InputError, match="0 readings at"):
        recorded_press(PAIR, recording, at_mm=(3.0, 3.0))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"depth_mm": [0.0, 1.0, np.nan], "signal": [1.0, 2.0, 3.0]}, "4: depth_mm is 'nan'"),
        ({"depth_mm": [0.0, 1.0], "signal": [np.nan, np.nan]}, "2: signal ... 'nan', needs"),
        ({"depth": [0.0, 1.0], "signal": [1.0, 2.0]}, "CSV with ... depth_mm"),
        ({"depth_mm": [0.0, 1.0], "light": [1.0, 2.0]}, "CSV with ... depth_mm"),
        ({"depth_mm": [], "signal": []}, "0 rows below the heading"),
    ],
)
def test_a_csv_with_gaps_or_missing_columns_is_refused(tmp_path, columns, words):
    with pytest.raises(InputError, match=pattern(words)):
        read_recording(csv_of(tmp_path, columns))


def test_a_csv_with_words_for_numbers_is_refused(tmp_path):
    (tmp_path / "press.csv").write_text("depth_mm,signal\n0,5\n1,high\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"3: signal.*'high'"):
        read_recording(tmp_path / "press.csv")


@pytest.mark.parametrize("name", ["counts", "press_depth", "receiver"])
def test_a_netcdf_without_a_part_is_refused_by_its_name(tmp_path, name):
    with pytest.raises(InputError, match=f"has no {name}"):
        read_recording(netcdf_of(tmp_path, drop=[name]))


def test_a_file_that_is_no_netcdf_is_refused(tmp_path):
    (tmp_path / "press.nc").write_bytes(b"no\x00")
    with pytest.raises(InputError, match="netCDF"):
        read_recording(tmp_path / "press.nc")


@pytest.mark.parametrize(
    ("pairs", "words"), [(("E9-R9",), "'E9-R9' is no pair here"), (("E1-R2",), "'E1-R2' is no pair here")]
)
def test_an_unknown_pair_is_refused_with_those_there_are(tmp_path, pairs, words):
    with pytest.raises(InputError, match=words):
        recorded_press(PAIR, read_recording(netcdf_of(tmp_path)), pairs=pairs)


def test_a_recording_that_never_leaves_the_pad_is_refused(simulated, tmp_path):
    with pytest.raises(InputError, match="no untouched reading"):
        recorded_press(
            PAIR, read_recording(netcdf_of(tmp_path, depth_mm=np.linspace(0.5, 4.0, 9))), pairs=("E2-R2",)
        )


def test_the_verb_writes_figure_and_figures_into_the_bundle(simulated, tmp_path, capsys):
    file = netcdf_of(tmp_path)
    command = [
        "compare",
        "piacenza2017-pair",
        str(file),
        "--pair",
        "E2-R2",
        "--out",
        str(tmp_path / "out"),
        "--json",
    ]
    assert main(command) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["pairs"][0]["rms"] < 1e-6
    assert {path.suffix for path in (next((tmp_path / "out").iterdir()) / "sims").iterdir()} == {
        ".json",
        ".svg",
        ".png",
    }


@pytest.mark.slow
def test_the_press_is_simulated_at_the_place_of_the_recording(tmp_path):
    centred, beside = (
        recorded_press(PAIR, read_recording(netcdf_of(tmp_path, place=place)), pairs=("E2-R2",)).pairs[0]
        for place in ((10.0, 10.0), (10.0, 12.5))
    )
    assert centred.simulated.score.modes.mode2_mm[0] == pytest.approx(
        1.73, abs=0.05
    )  # the score's own, seeds apart
    assert beside.simulated.curves.press_mm == (10.0, 12.5)
    # a tip beside the chord blocks less: more light is left at full depth
    assert beside.simulated.curves.total[-1] > 2 * centred.simulated.curves.total[-1]


@pytest.mark.parametrize("fill", [-999.0, 65535.0, 9.969209968386869e36])
def test_a_gap_in_a_table_is_refused_with_its_place(tmp_path, fill):
    signal = 800.0 * ratio_at(DEPTH_MM)
    signal[7] = fill
    file = csv_of(tmp_path, {"depth_mm": DEPTH_MM, "E2-R2": signal})
    with pytest.raises(InputError, match=r"E2-R2: 1.*index 7"):
        read_recording(file)


def test_lengths_in_any_spelling_are_read(tmp_path):
    place = np.ones(len(DEPTH_MM))
    columns = {
        "Depth (mm)": DEPTH_MM,
        "X [cm]": place,
        "y_m": 0.01 * place,
        "E2-R2": 800.0 * ratio_at(DEPTH_MM),
    }
    found = read_recording(csv_of(tmp_path, columns))
    assert found.depth_mm == pytest.approx(DEPTH_MM, abs=1e-6)
    assert found.place_mm is not None
    assert found.place_mm == pytest.approx(10.0)

"""One small whole file of every kind that optopad reads, to be damaged."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np
import xarray as xr

from optopad.design.preset import preset
from optopad.fabrication.driver.link.protocol import FrameFormat, pack_frames
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver_config import dump_driver_config
from optopad.sims.learning.inference.extra_trees import ExtraTreesModel, Forest
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA, FeatureScaling
from optopad.sims.readings.dataset import save_data
from tests.fabrication.driver.made_up_pad import pad_config, untouched
from tests.sims.learning.made_up_map import made_up_map_model
from tests.sims.learning.made_up_models import PAIRS, made_up_header, made_up_kernel_ridge, made_up_touch
from tests.sims.readings.test_dataset import made_up

PAD = "piacenza2017-pad"
SAMPLES = 40


def write_good_files(folder: Path) -> None:
    """The files of `READERS`, each named by its kind."""
    _write_models(folder)
    _write_netcdf(folder)
    (folder / "driver.toml").write_text(dump_driver_config(preset(PAD), 1e5, np.minimum(untouched(), 1023)))
    counts = np.random.default_rng(2).integers(0, 1024, (SAMPLES, 9, 8))
    frames = pack_frames(
        FrameFormat(emitters=8, receivers=8, bits=10),
        range(SAMPLES),
        [2500 * k for k in range(SAMPLES)],
        counts,
    )
    for name in ("raw.optorec", "bag.mcap"):
        with Recorder(folder / name, pad_config()) as recorder:
            for number, message in enumerate(frames):
                recorder.frame(message, 1000.0 + number)
                if number % 10 == 0:
                    recorder.press(16.0, 16.0, number / 10.0, 1000.5 + number)
    for kind, name in (("search.spaces", "pair-heights"), ("protocols", "piacenza2017-quick")):
        text = (files(f"optopad.design.{kind}") / f"{name}.toml").read_text(encoding="utf-8")
        (folder / f"{kind.rpartition('.')[2]}.toml").write_text(text, encoding="utf-8")


def _write_models(folder: Path) -> None:
    chance = np.random.default_rng(1)
    shared = {
        "touch": made_up_touch(),
        "scaling": FeatureScaling(
            kept=np.arange(PAIRS), centre=np.full(PAIRS, 120.0), scale=np.full(PAIRS, 10.0)
        ),
        "sigma": UNIT_SIGMA,
    }
    forest = Forest(
        roots=np.array([0, 3], np.int32),
        feature=np.array([1, -1, -1, 2, -1, -1], np.int16),
        threshold=np.zeros(6, np.float32),
        other=np.array([2, 0, 1, 5, 2, 3], np.int32),
        leaf_mm=chance.uniform(1.0, 5.0, (4, 3)).astype(np.float32),
    )
    models = {
        "kernel-ridge": made_up_kernel_ridge(),
        "signal-map": made_up_map_model(),
        "extra-trees": ExtraTreesModel(header=made_up_header(kind="extra-trees"), forest=forest, **shared),
    }
    for name, model in models.items():
        save_model(folder / f"{name}.optomodel", model)


def _write_netcdf(folder: Path) -> None:
    save_data(made_up(), folder / "data.nc")
    time, design = np.arange(SAMPLES), preset(PAD)
    names = [f"E{k + 1}" for k in range(8)], [f"R{k + 1}" for k in range(8)]
    xr.Dataset(
        {
            "counts": (("time", "state", "receiver"), np.full((SAMPLES, 9, 8), 300.0), {"units": "count"}),
            "press_depth": ("time", np.maximum(0.0, time / 10.0 - 1.0), {"units": "mm"}),
            "press_x": ("time", np.full(SAMPLES, 16.0)),
            "press_y": ("time", np.full(SAMPLES, 16.0)),
        },
        coords={"state": [*names[0], "off"], "receiver": names[1]},
        attrs={"design_digest": design.digest},
    ).to_netcdf(folder / "recording.nc", engine="h5netcdf")
    presses = np.array([(x, y, depth) for x in (9.0, 16.0) for y in (9.0, 16.0) for depth in (0.0, 1.0, 2.0)])
    axes = ("state", "emitter", "receiver")
    xr.Dataset(
        {
            "flux": (axes, np.full((len(presses), 8, 8), 1e-3)),
            **{f"press_{axis}": ("state", presses[:, k]) for k, axis in enumerate(("x", "y", "depth"))},
        },
        coords={"emitter": names[0], "receiver": names[1]},
        attrs={"design_digest": design.digest},
    ).to_netcdf(folder / "signals.nc", engine="h5netcdf")

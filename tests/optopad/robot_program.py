"""What a robot's computer does with the driver alone. Runs in an environment without the packages that design a sensor.

The current folder holds driver.toml, the models named as their kinds, frames for them, and each model's predictions.
The arguments are the recordings to write.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np

import optopad
import optopad.fabrication.driver
import optopad.fabrication.stage
import optopad.sims.learning.inference
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.position_log import read_position_log
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver.simulated.press_table import untouched_table
from optopad.fabrication.driver_file import load_driver_config
from optopad.sims.learning.inference.model_file import save_model

FRAMES = 20
HEAVY = {"cadquery", "mujoco", "numba", "pydantic", "scipy", "typer", "xarray"}


def import_all() -> int:
    """Import every module of the driver, its stage and its models; count them."""
    count = 0
    for room in (optopad.fabrication.driver, optopad.fabrication.stage, optopad.sims.learning.inference):
        for module in pkgutil.walk_packages(room.__path__, room.__name__ + "."):
            importlib.import_module(module.name)
            count += 1
    return count


def predict_all(again: Path) -> None:
    """Compare the predictions of every kind of model with those of the environment that made them.

    Each is also written to the file `again`, and read back.
    """
    signals = {"pad": np.load("pad.npy"), "signal-map": np.load("map.npy")}
    for file in sorted(Path().glob("*.optomodel")):
        save_model(again, optopad.load_model(file))
        found = optopad.load_model(again).predict(signals.get(file.stem, signals["pad"]))
        wanted = np.load(file.with_suffix(".predicted.npy"))
        # other versions of NumPy and of its linear algebra round sums in single precision otherwise
        assert np.allclose(found.press_mm, wanted, rtol=0.0, atol=1e-3), (file, found.press_mm, wanted)


def read_times() -> None:
    """Read times of ISO 8601 that the parser of Python 3.10 refuses."""
    log = Path(sys.argv[1]).with_name("log.csv")
    moments = ("2026-05-04T14:03:07.25Z", "2026-05-04T16:03:08.123456789+02:00")
    rows = [f"{moment},16,16,{depth}" for depth, moment in enumerate(moments)]
    log.write_text("\n".join(["time,x_mm,y_mm,depth_mm", *rows]) + "\n", encoding="utf-8")
    assert np.allclose(np.diff(read_position_log(log).time_s), 0.873456, rtol=0.0, atol=1e-6)


def read_and_record(files: list[str]) -> None:
    """Read a simulated board in every way, and record it into files, which are read back."""
    config = load_driver_config("driver.toml")
    with FakePort(FakeBoard(config, untouched_table(config))) as port:
        with optopad.Sensor("driver.toml", port.name) as sensor:
            with ExitStack() as recorders:
                for file in files:
                    recorders.enter_context(sensor.record(file))
                frames = list(sensor.frames(count=sensor.waiting + FRAMES))  # those that wait came before
            assert frames[-1].signals.shape == (8, 8)
            for file in files:
                assert len(optopad.read_recording(file).sequence) >= FRAMES, file
            step = optopad.Observations(sensor, fps=30).step()
            assert all(np.isfinite(values).all() for values in step.values()), step
        with optopad.Sensor(config, port.name) as sensor:
            reader = optopad.TouchReader(sensor, optopad.load_model("kernel-ridge.optomodel"))
            touches = list(reader.touches(count=5))
            assert not any(touch.is_touched for touch in touches)
    refused = ""
    try:
        optopad.Sensor("piacenza2017-pad")  # a design needs more than the driver
    except InputError as err:
        refused = str(err)
    assert "name the bundle" in refused, refused


if __name__ == "__main__":
    modules = import_all()
    predict_all(Path(sys.argv[1]).with_name("again.optomodel"))
    read_times()
    read_and_record(sys.argv[1:])
    assert not HEAVY & set(sys.modules), HEAVY & set(sys.modules)
    print("numpy", np.__version__, np.__file__)
    print("modules", modules)

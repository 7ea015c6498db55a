"""Entry points for users, in Python and in the terminal: from one design file to mold, verdict and driver.

    import optopad

    design = optopad.load("piacenza2017-pair")
    optopad.score(design).verdict
    optopad.score(design.with_(**{"cavity.clear_thickness_mm": 10})).deadbands_mm

    with optopad.Sensor("driver.toml") as sensor:  # the finished pad; needs numpy and pyserial alone
        for touch in optopad.TouchReader(sensor, optopad.load_model("pad.optomodel")).touches(seconds=3.0):
            print(touch.press_mm, touch.force_n)

Parts, each importing only earlier ones: work, screen, results, report, jobs, sensor. Entry points: api (Python), cli
(terminal).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from optopad.api import (
    check,
    compare,
    improve,
    load,
    load_model,
    predict,
    presets,
    read_recording,
    run,
    save,
    score,
    sweep,
)

if TYPE_CHECKING:
    from fabrication.driver.sensor import Sensor
    from fabrication.driver.touch_reader import TouchReader

__all__ = [
    "Sensor",
    "TouchReader",
    "check",
    "compare",
    "improve",
    "load",
    "load_model",
    "predict",
    "presets",
    "read_recording",
    "run",
    "save",
    "score",
    "sweep",
]

_DRIVER = {"Sensor": "fabrication.driver.sensor", "TouchReader": "fabrication.driver.touch_reader"}
"""Modules of the driver's classes, which are imported when first used."""


def __getattr__(name: str) -> Any:
    if name not in _DRIVER:
        raise AttributeError(f"module 'optopad' has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_DRIVER[name]), name)
    return found


def __dir__() -> list[str]:
    return __all__

"""Entry points for users, in Python and in the terminal: from one design file to mold, verdict and driver.

    import optopad

    design = optopad.load("piacenza2017-pair")
    optopad.score(design).verdict
    optopad.score(design.with_(**{"cavity.clear_thickness_mm": 10})).deadbands_mm

    with optopad.Sensor("driver.toml") as sensor:  # the finished pad; needs numpy and pyserial alone
        for touch in optopad.TouchReader(sensor, optopad.load_model("pad.optomodel")).touches(seconds=3.0):
            print(touch)

Parts, each importing only earlier ones: work, screen, report, bundle_parts, sensor. Entry points: api (Python), cli
(terminal).
"""

from optopad.api import __getattr__ as __getattr__
from optopad.api import (
    load,
    load_model,
    presets,
    read_recording,
    save,
)

TYPE_CHECKING = False  # as in typing, which takes a while to load
if TYPE_CHECKING:
    from optopad.sims.robot.forward import forward as forward
    from optopad.verbs.check import check as check
    from optopad.verbs.compare import compare as compare
    from optopad.verbs.improve import improve as improve
    from optopad.verbs.predict import predict as predict
    from optopad.verbs.press import press as press
    from optopad.verbs.run import run as run
    from optopad.verbs.score import score as score
    from optopad.verbs.sweep import sweep as sweep

__version__ = "0.2.0"

__all__ = [
    "Observations",
    "Sensor",
    "SimulatedPad",
    "SimulatedSensor",
    "TouchReader",
    "check",
    "compare",
    "forward",
    "improve",
    "load",
    "load_model",
    "predict",
    "presets",
    "press",
    "read_recording",
    "run",
    "save",
    "score",
    "sweep",
]

"""Functions of `import optopad`: load, check, score, sweep, compare, improve, predict, press, run, load_model,
read_recording.

Most functions take a design and return a result; nothing is printed. Long computations take `on_step`, a function that
is called with a step's name and its finished fraction. They write files into the bundles in the folder `out`, as the
command line does.
"""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign
    from optopad.fabrication.driver.recording.recorded import Recorded
    from optopad.sims.learning.inference.touch_model import TouchModel

OUT = "outputs"
"""Default folder of the bundles (designs' output folders), the same as on the command line."""


def presets() -> tuple[str, ...]:
    """Names of the packaged designs."""
    from optopad.design.preset import PRESETS

    return PRESETS


def load(where: str | PathLike[str], /, **changes: Any) -> SensorDesign:
    """Load a design from a file, a bundle's folder, or a preset's name.

    Parameters
    ----------
    changes : fields to change, with two underscores for the dot: ``cavity__clear_thickness_mm=10`` has the effect of
        ``design.with_(**{"cavity.clear_thickness_mm": 10})``

    Raises
    ------
    DesignError, InputError : the file or a change is invalid.
    """
    from optopad.work import read_design

    design = read_design(str(where), None)
    return (
        design.with_(**{name.replace("__", "."): value for name, value in changes.items()})
        if changes
        else design
    )


def save(design: SensorDesign, file: str | PathLike[str]) -> Path:
    """Write a design as TOML; the design loaded from this file has the same digest."""
    from optopad.design.io import save_design

    save_design(design, file)
    return Path(file)


def load_model(file: str | PathLike[str]) -> TouchModel:
    """Read a trained model, which `optopad.TouchReader` applies to a sensor's frames.

    Raises
    ------
    InputError : the file is missing or damaged, or has a version or kind of model that this optopad does not support.
    """
    from optopad.sims.learning.inference.model_file import load_model as read

    return read(file)


def read_recording(
    file: str | PathLike[str], *, topic: str | None = None, press_topic: str | None = None
) -> Recorded:
    """Read the frames of a recording of `optopad driver record` or `Sensor.record`, or of a ROS 2 bag.

    Parameters
    ----------
    topic, press_topic : topics of frames and presses in a bag of several sensors

    Raises
    ------
    InputError : the file is not a recording, or contains no complete frame; topics or times do not clearly belong
        together.
    """
    from optopad.fabrication.driver.recording.export import read_recorded

    return read_recorded(Path(file), topic=topic, press_topic=press_topic)


_LATER = {
    "Observations": "optopad.fabrication.driver.observations",
    "Sensor": "optopad.sensor",
    "SimulatedPad": "optopad.fabrication.scene.simulated_pad",
    "SimulatedSensor": "optopad.fabrication.scene.simulated_sensor",
    "TouchReader": "optopad.fabrication.driver.touch_reader",
    "check": "optopad.verbs.check",
    "compare": "optopad.verbs.compare",
    "forward": "optopad.sims.robot.forward",
    "improve": "optopad.verbs.improve",
    "predict": "optopad.verbs.predict",
    "press": "optopad.verbs.press",
    "run": "optopad.verbs.run",
    "score": "optopad.verbs.score",
    "sweep": "optopad.verbs.sweep",
}
"""Names of `import optopad` that are imported when first used, and their modules."""


def __getattr__(name: str) -> Any:
    """A verb, or a class of the driver, as an attribute of `optopad`."""
    if name not in _LATER:
        raise AttributeError(f"module 'optopad' has no attribute {name!r}")
    return getattr(import_module(_LATER[name]), name)

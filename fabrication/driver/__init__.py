"""Driver of a manufactured sensor: receives frames over a serial line. It imports no CAD kernel and no models."""

from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.sensor import Sensor

__all__ = ["Frame", "Sensor"]

"""Driver of a manufactured unit: frames over a serial line. It runs without the CAD kernel and the physics."""

from fabrication.driver.link.frames import Frame
from fabrication.driver.sensor import Sensor

__all__ = ["Frame", "Sensor"]

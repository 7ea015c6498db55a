"""The built sensor at the bench: frames over a serial line. Runs without the CAD kernel and without the physics."""

from fabrication.driver.link.frames import Frame
from fabrication.driver.sensor import Sensor

__all__ = ["Frame", "Sensor"]

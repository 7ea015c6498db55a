"""Light: rays from every emitter to every receiver through the deformed pad."""

from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.optics.tracing import trace

__all__ = ["LightSignals", "trace"]

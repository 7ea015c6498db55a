"""Light: rays from every emitter to every receiver through the deformed pad."""

from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace

__all__ = ["LightSignals", "trace"]

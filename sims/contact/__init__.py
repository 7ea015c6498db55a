"""Contact: MuJoCo soft contact gives the deformed surface, force and contact radius."""

from sims.contact.indentation import indent
from sims.press import Indentation

__all__ = ["Indentation", "indent"]

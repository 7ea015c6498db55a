"""Contact: deformed surface, force and contact radius, solved with MuJoCo's soft contact."""

from optopad.sims.contact.indentation import indent
from optopad.sims.press import Indentation

__all__ = ["Indentation", "indent"]

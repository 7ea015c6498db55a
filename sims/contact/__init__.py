"""Contact: deformed surface, force and contact radius, solved with MuJoCo's soft contact."""

from sims.contact.indentation import indent
from sims.press import Indentation

__all__ = ["Indentation", "indent"]

"""Mechanical contact: deformed surface, force and contact radius of a press, solved with MuJoCo's soft contact."""

from sims.contact.indentation import indent
from sims.press import Indentation

__all__ = ["Indentation", "indent"]

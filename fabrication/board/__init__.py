"""Circuit boards that can be ordered: under a mold with parts in its walls, or with the parts on the board itself.

A KiCad project, Gerber and drill files, a bill and a placement file; `Board` is the board as plain data.
"""

from optopad.fabrication.board.files import unrouted_words, write_board, write_gaps
from optopad.fabrication.board.making import board_of
from optopad.fabrication.board.model import Board
from optopad.fabrication.board.netlist import board_gaps

__all__ = ["Board", "board_gaps", "board_of", "unrouted_words", "write_board", "write_gaps"]

"""Finds complete messages in a stream of bytes that may be damaged, cut, or begin in the middle of a message.

A message begins with two fixed bytes (the magic) and a byte that gives its type. Bytes that begin in this way are a
candidate, which is a message if its CRC matches. Otherwise the search continues one byte further on, so that no
complete message after a damaged one is lost. From one piece of the stream to the next, less than one message is kept.

If a candidate turns out not to be a message, the bytes after its start have waited until its full length arrived.
"""

from __future__ import annotations

from collections.abc import Mapping

from optopad.fabrication.driver.link.protocol import MAGIC, is_whole

Message = tuple[int, bytes]
"""A message from the board: its byte 2, which gives its type, and all its bytes."""

HEAD_BYTES = 3


class Scanner:
    """Finds the complete messages in successive pieces of a stream.

    Parameters
    ----------
    lengths : length in bytes of each type of message, by the message's byte 2
    magic : the two bytes with which a message begins
    """

    def __init__(self, lengths: Mapping[int, int], magic: bytes = MAGIC) -> None:
        self._lengths = dict(lengths)
        self._magic = magic
        self._kept = b""
        self.damaged = 0
        """Number of byte sequences so far that began like a message but had a wrong CRC."""
        self.skipped_bytes = 0
        """Number of bytes so far that belong to no message; bytes of a message still arriving are not counted."""

    @property
    def kept_bytes(self) -> int:
        """Number of bytes received so far of a possible message that is not yet complete."""
        return len(self._kept)

    def forget(self) -> None:
        """Discard the bytes of an unfinished message, for example after an interruption of the line."""
        self.skipped_bytes += len(self._kept)
        self._kept = b""

    def feed(self, piece: bytes) -> list[Message]:
        """The messages that this piece of the stream completes, in the order of arrival."""
        stream = self._kept + piece if self._kept else piece
        found: list[Message] = []
        at, end = 0, len(stream)
        while True:
            begun = stream.find(self._magic, at)
            if begun < 0:
                at = end - 1 if stream.endswith(self._magic[:1], at) else end
                break
            at = begun
            if at + HEAD_BYTES > end:
                break
            length = self._lengths.get(stream[at + 2])
            if length is None:
                at += 1
            elif at + length > end:
                break
            elif is_whole(message := stream[at : at + length]):
                found.append((message[2], message))
                at += length
            else:
                self.damaged += 1
                at += 1
        self._kept = stream[at:]
        self.skipped_bytes += at - sum(
            len(message) for _, message in found
        )  # in one step: others may be reading it
        return found

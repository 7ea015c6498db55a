"""Search for messages in a stream of bytes that may be damaged, cut or started anywhere.

A candidate begins with the magic and a known byte 2. It is a message if its CRC is right. Otherwise the search
continues one byte further, so that a damaged message never removes a complete one behind it. The bytes kept from
one piece of the stream to the next are always shorter than one message.

A false candidate delays the following bytes until its full length has arrived.
"""

from __future__ import annotations

from collections.abc import Mapping

from fabrication.driver.link.protocol import MAGIC, is_whole

Message = tuple[int, bytes]
"""Byte 2 and the complete message."""

HEAD_BYTES = 3


class Scanner:
    """Finds the complete messages in pieces of a stream.

    Parameters
    ----------
    lengths : length of each message by its byte 2
    magic : the two bytes that begin one
    """

    def __init__(self, lengths: Mapping[int, int], magic: bytes = MAGIC) -> None:
        self._lengths = dict(lengths)
        self._magic = magic
        self._kept = b""
        self.damaged = 0
        """Number of candidates whose CRC was wrong."""
        self.skipped_bytes = 0
        """Bytes so far that belong to no complete message; those of an unfinished one are not counted."""

    @property
    def kept_bytes(self) -> int:
        """Bytes of an unfinished candidate that wait for the rest."""
        return len(self._kept)

    def forget(self) -> None:
        """Drop an unfinished candidate, as after a break of the line."""
        self.skipped_bytes += len(self._kept)
        self._kept = b""

    def feed(self, piece: bytes) -> list[Message]:
        """The messages that this piece completes, in order."""
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

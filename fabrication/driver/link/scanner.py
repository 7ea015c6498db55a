"""Finds complete messages in a stream of bytes that may be damaged, cut, or begin in the middle of a message.

A message begins with two fixed bytes (the magic), and a byte for its kind. A run of bytes that begins so is a
candidate. It is a message if its CRC matches. Otherwise the search continues one byte further, so that no complete
message after a damaged one is lost. Less than one message is kept from one piece of the stream to the next.

A false candidate delays the following bytes until its full length has arrived.
"""

from __future__ import annotations

from collections.abc import Mapping

from fabrication.driver.link.protocol import MAGIC, is_whole

Message = tuple[int, bytes]
"""A message from the board: byte 2, which gives its kind, and all its bytes."""

HEAD_BYTES = 3


class Scanner:
    """Finds the complete messages in successive pieces of a stream.

    Parameters
    ----------
    lengths : length in bytes of each kind of message; the key is byte 2 of the message
    magic : the two bytes with which a message begins
    """

    def __init__(self, lengths: Mapping[int, int], magic: bytes = MAGIC) -> None:
        self._lengths = dict(lengths)
        self._magic = magic
        self._kept = b""
        self.damaged = 0
        """Number of byte sequences so far that began as a message but whose CRC did not match."""
        self.skipped_bytes = 0
        """Number of bytes so far that belong to no message; bytes of a message still arriving are not counted."""

    @property
    def kept_bytes(self) -> int:
        """Number of bytes received of a possible message whose end has not arrived."""
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

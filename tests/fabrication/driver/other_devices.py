"""Devices that are no sensor: printers of several firmwares, and what else has a serial chip."""

from __future__ import annotations

from collections.abc import Callable

NEVER_S = 1e9
BOOT_S = 0.05


class Talker:
    """A device that says something after its reset, and answers what it is told.

    Attributes
    ----------
    told, opened : all that it was told, and how often its port was opened
    """

    def __init__(self, says: bytes, answer: Callable[[bytes], bytes]) -> None:
        self._says, self._answer = says, answer
        self._due_s = NEVER_S
        self.told: list[bytes] = []
        self.opened = 0

    @property
    def due_s(self) -> float:
        return self._due_s

    def reset(self, now_s: float) -> None:
        self.opened += 1
        self._due_s = now_s + BOOT_S

    def spoken(self, now_s: float) -> bytes:
        if now_s < self._due_s:
            return b""
        self._due_s = NEVER_S
        return self._says

    def heard(self, piece: bytes, now_s: float) -> bytes:
        self.told.append(piece)
        return self._answer(piece)


def _m115(answer: bytes) -> Callable[[bytes], bytes]:
    return lambda piece: answer if b"M115" in piece else b""


_SAYINGS: dict[str, tuple[bytes, Callable[[bytes], bytes]]] = {
    "Marlin 1.0": (
        b"start\necho:Marlin 1.0.0\n",
        _m115(b"ok FIRMWARE_NAME:Marlin V1; PROTOCOL_VERSION:1.0\n"),
    ),
    "Marlin 2": (b"", _m115(b"FIRMWARE_NAME:Marlin 2.1.2 (Jan  1 2024) MACHINE_TYPE:3D Printer\nok\n")),
    "halted Marlin": (b"start\nError:Printer halted. kill() called!\n", lambda _: b""),
    "Klipper's host": (b"", _m115(b"// FIRMWARE_NAME:Klipper FIRMWARE_VERSION:v0.12\nok\n")),
    # an empty block of Klipper's protocol: 05 10, its CRC-16, 7e; Klipper answers this to every valid or damaged block
    "Klipper's board": (b"", lambda _: bytes.fromhex("05109e817e")),
    "RepRapFirmware": (
        b"",
        _m115(b"FIRMWARE_NAME: RepRapFirmware for Duet 2 FIRMWARE_VERSION: 3.4.5\r\nok\r\n"),
    ),
    "Repetier": (b"start\r\nInfo:External Reset\r\n", _m115(b"FIRMWARE_NAME:Repetier_1.0.4\r\nok\r\n")),
    "Smoothie": (b"Smoothie\r\nok\r\n", _m115(b"FIRMWARE_NAME:Smoothieware, PROTOCOL_VERSION:1.0\nok\n")),
    "Grbl": (b"\r\nGrbl 1.1h ['$' for help]\r\n", _m115(b"error:20\r\n")),
}
PRINTERS = tuple(_SAYINGS)


def printer_of(firmware: str) -> Talker:
    """A printer with such a firmware."""
    return Talker(*_SAYINGS[firmware])

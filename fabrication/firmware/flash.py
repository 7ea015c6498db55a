"""Uploading an image over the board's boot loader, by avrdude.

The command is a pure function of board, image and port, so that it can be shown without being run. avrdude
checks the chip's signature before it writes and reads everything back afterwards.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from design.errors import DeviceError
from design.parts.board_firmware import BoardFirmware

UPLOADER = "avrdude"
UPLOAD_LIMIT_S = 180.0
"""A whole chip at 115200 baud, written and read back, takes about a minute."""

SHOWN_LINES = 3

CAUSES: Mapping[str, str] = MappingProxyType(
    {
        "permission denied": "you may not use the port: join its group (Debian and Ubuntu: dialout), then log in anew",
        "busy": "something else has the port open: end it (a serial monitor, `driver read`), then try again",
        "not in sync": "no boot loader answers: is it this board and its port? Press its reset button just before",
        "timeout": "no boot loader answers: is it this board and its port? Press its reset button just before",
        "signature": "the chip is another one than the design's board has: correct board.kind or take the other board",
        "verification error": "what was written reads back differently: try again, with another cable",
    }
)
"""What avrdude says, in lower case, and what helps."""


def upload_command(chip: BoardFirmware, image: Path, port: str) -> list[str]:
    """What is run to write an image to the board at a port."""
    return [
        UPLOADER,
        *("-p", chip.mcu, "-c", chip.programmer, "-P", port, "-b", str(chip.upload_baud)),
        "-D",  # these boot loaders erase page by page; avrdude's own erasing of the chip fails on them
        *("-U", f"flash:w:{image}:i"),
    ]


def require_uploader(port: str) -> None:
    """Refuse what cannot begin: DeviceError for no avrdude, or no such port."""
    if shutil.which(UPLOADER) is None:
        raise DeviceError(
            f"{UPLOADER} is not installed here; install it (Debian and Ubuntu: avrdude), or upload the sketch folder "
            "with the Arduino IDE"
        )
    if os.sep == "/" and not Path(port).exists():
        raise DeviceError(f"{port}: no such port; plug the board in and name the port that then appears")


def upload(chip: BoardFirmware, image: Path, port: str) -> None:
    """Write an image to the board at a port, and read it back.

    Raises
    ------
    DeviceError : no avrdude, no such port, or avrdude's own words with what helps.
    """
    require_uploader(port)
    command = upload_command(chip, image, port)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=UPLOAD_LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        raise DeviceError(
            f"{port}: {UPLOADER} had not finished after {UPLOAD_LIMIT_S:g} s; unplug the board, plug it in, try again"
        ) from None
    except OSError as err:
        raise DeviceError(f"{UPLOADER} cannot be started: {err.strerror or err}") from err
    if done.returncode:
        raise DeviceError(f"{port}: the upload failed: {_explained(done.stderr or done.stdout)}")


def _explained(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    shown = " | ".join(lines[-SHOWN_LINES:]) or f"{UPLOADER} said nothing"
    help_ = next((way_out for words, way_out in CAUSES.items() if words in said.lower()), "")
    return f"{shown}; {help_}" if help_ else shown

"""Uploads the firmware of a design to its board."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from optopad.cli.verb import typed, verb
from optopad.design.errors import DeviceError, InputError
from optopad.design.files import read_bytes
from optopad.design.pad import Pad
from optopad.design.parts.board_firmware import ArduinoProgram, BoardFirmware
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.link import require_no_printer
from optopad.fabrication.driver.link.ports import GUESSED, find_port, is_guess, port_of_serial
from optopad.fabrication.driver.sensor import PATIENCE_S
from optopad.fabrication.driver_config import driver_config
from optopad.fabrication.driver_file import BoardSetup
from optopad.fabrication.flash import (
    MOST_IMAGE_BYTES,
    avr_chip,
    boot_drive,
    copy_uf2,
    mounted_drives,
    require_port,
    require_uf2,
    require_uploader,
    sketch_command,
    upload,
    upload_command,
)
from optopad.fabrication.sketch import firmware_settings
from optopad.screen.output import Told
from optopad.verbs.driver.firmware import write_firmware
from optopad.work import OUT


@verb(port=typed(), image=typed(), set_before="out")
def flash(
    design: SensorDesign,
    *,
    port: str | None = None,
    image: Path | None = None,
    dry_run: bool = False,
    yes: bool = False,
    patience: float | None = None,
    out: Path = Path(OUT),
    seed: int = 0,
    as_json: bool = False,
) -> Told:
    """Upload the firmware of a design to its board, with avrdude or arduino-cli; a port where a printer replies is
    refused.

    Parameters
    ----------
    port : Serial port, as /dev/ttyACM0 or serial:NUMBER, or with a .uf2 file the boot drive; else found.
    image : A compiled file to upload instead of the design's: .hex, or for boards with a boot drive .uf2.
    dry_run : Print the command without uploading.
    yes : Do not ask about a port that is identified by its serial chip only.
    """
    settings = firmware_settings(Pad.of(design))
    chip, board = settings.chip, board_setup(design)
    if image is not None and not isinstance(chip, BoardFirmware) and chip.boot_drive is not None:
        return _copied(chip, image, port, is_dry=dry_run)
    if image is not None or isinstance(chip, BoardFirmware):
        avr = avr_chip(settings)
        file = image_to_upload(design, out, seed=seed) if image is None else given_image(image)
    else:
        file = write_firmware(design, out, seed=seed).sketch
    if not dry_run:
        require_uploader(chip, file)
    found = (
        _found_port(board, is_agreed=yes or dry_run, may_ask=not as_json)
        if port is None
        else port_of_serial(port)
    )
    command = (
        upload_command(avr, file, found)
        if isinstance(chip, BoardFirmware)
        else sketch_command(chip, file, found)
    )
    if not dry_run:
        require_port(found)
        print(f"listening {found}: is the device a printer?", file=sys.stderr)
        require_no_printer(found, board.baud, PATIENCE_S if patience is None else patience)
        upload(command, found)
    return _told(command, found, file, is_uploaded=not dry_run)


def _told(command: list[str], port: str, image: Path, *, is_uploaded: bool) -> Told:
    document = {"command": command, "port": port, "image": str(image), "uploaded": is_uploaded}
    done = f"uploaded  {image} to {port}; the board starts within 3 s"
    return Told(document, [done if is_uploaded else shlex.join(command)])


def _copied(chip: ArduinoProgram, image: Path, drive: str | None, *, is_dry: bool) -> Told:
    """Copy a UF2 file to the board's drive; `drive` is the folder of the drive, or None to find it."""
    require_uf2(chip, image)
    found = boot_drive(chip, mounted_drives() if drive is None else [Path(drive)])
    if not is_dry:
        copy_uf2(image, found)
    return _told(["cp", str(image), str(found)], str(found), image, is_uploaded=not is_dry)


def _found_port(board: BoardSetup, *, is_agreed: bool, may_ask: bool) -> str:
    """Name of the board's port, found by the USB identity.

    A port that is identified only by a common serial chip needs the user's consent (`is_agreed`, or a question if
    `may_ask`).
    """
    found = find_port(board)
    if is_agreed or not is_guess(found, board):
        return found.name
    if not (may_ask and sys.stdin.isatty()):
        raise DeviceError(
            f"{found}: {GUESSED} Nothing was opened or written; if it is the board, name it: --port {found.name}, or "
            "add --yes"
        )
    answer = input(f"{found}: {GUESSED} Write the sensor's firmware to it? [y/N] ")
    if answer.strip().lower() not in ("y", "yes"):
        raise DeviceError(f"{found}: nothing was opened or written; name the board's port with --port")
    return found.name


def image_to_upload(design: SensorDesign, out: Path, *, seed: int) -> Path:
    """The image of a design, compiled now, or taken from its bundle if there is no compiler.

    Raises
    ------
    DeviceError : there is no compiler, and the bundle has no image of this firmware.
    """
    files = write_firmware(design, out, seed=seed)
    if files.image_file is None:
        raise DeviceError(
            f"{files.sketch}: nothing to upload: {files.no_image_because}; with a compiler installed, "
            "this command makes the image itself"
        )
    return files.image_file


def board_setup(design: SensorDesign) -> BoardSetup:
    """The board for the driver: its USB identities and its line."""
    return driver_config(design).board


def given_image(file: Path) -> Path:
    """The compiled program in a file that the user names.

    Raises
    ------
    InputError : the file does not exist or is not an Intel HEX file.
    """
    content = read_bytes(file, needed="the .hex file of a program", most_bytes=MOST_IMAGE_BYTES)
    if not (content.startswith(b":") and content.isascii()):
        raise InputError(f"{file}: no Intel HEX; name the .hex file that `optopad driver firmware` wrote")
    return file

"""Commands for the firmware of the board: driver firmware, driver flash."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.design.errors import DeviceError
from optopad.screen.output import print_json, say
from optopad.work import read_design

if TYPE_CHECKING:
    from optopad.design.parts.board_firmware import ArduinoProgram
    from optopad.fabrication.driver_file import BoardSetup


def firmware(
    design: options.Design,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Write the sketch folder of a design for the Arduino IDE, and a .hex file if avr-gcc is installed."""
    from optopad.fabrication.sketch import firmware_settings
    from optopad.sensor.firmware import write_firmware

    read = read_design(design, set_)
    settings, files = firmware_settings(read), write_firmware(read, out, seed=seed)
    image = files.image
    if as_json:
        print_json(
            {
                "sketch": str(files.sketch),
                "board": settings.chip.arduino_board,
                "image": None if files.image_file is None else str(files.image_file),
                "no_image_because": files.no_image_because,
                "flash_bytes": None if image is None else image.flash_bytes,
                "ram_bytes": None if image is None else image.ram_bytes,
                "config_crc": settings.config_crc(),
            }
        )
        return
    say(f"sketch    {files.sketch}")
    say(f"board     {settings.board_title} ({settings.chip.arduino_board})")
    if image is None:
        say(f"no .hex   {files.no_image_because}")
    else:
        say(f"image     {files.image_file}")
        say(
            f"takes     {_share(image.flash_bytes, settings.chip.flash_bytes)} of program memory, "
            f"{_share(image.ram_bytes, settings.chip.ram_bytes)} of RAM"
        )


def flash(
    design: options.Design,
    port: Annotated[
        str | None,
        typer.Option(
            "--port",
            help="Serial port, as /dev/ttyACM0 or serial:NUMBER, or with a .uf2 file the boot drive; else found.",
        ),
    ] = None,
    image: Annotated[
        Path | None,
        typer.Option(
            "--image",
            help="A compiled file to upload instead of the design's: .hex, or for boards with a boot drive .uf2.",
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the command without uploading.")] = False,
    yes: Annotated[
        bool,
        typer.Option("--yes", help="Do not ask about a port that is identified by its serial chip only."),
    ] = False,
    patience: options.Patience = None,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Upload the firmware of a design to its board, with avrdude or arduino-cli; a port where a printer replies is
    refused.
    """
    from optopad.design.parts.board_firmware import BoardFirmware
    from optopad.fabrication.driver.link.ports import port_of_serial
    from optopad.fabrication.driver.link.printers import require_no_printer
    from optopad.fabrication.driver.sensor import PATIENCE_S
    from optopad.fabrication.flash import (
        avr_chip,
        require_port,
        require_uploader,
        sketch_command,
        upload,
        upload_command,
    )
    from optopad.fabrication.sketch import firmware_settings
    from optopad.sensor.firmware import board_setup, given_image, image_to_upload, write_firmware

    read = read_design(design, set_)
    settings = firmware_settings(read)
    chip, board = settings.chip, board_setup(read)
    if image is not None and not isinstance(chip, BoardFirmware) and chip.boot_drive is not None:
        _copy_image(chip, image, port, is_dry=dry_run, as_json=as_json)
        return
    if image is not None or isinstance(chip, BoardFirmware):
        avr = avr_chip(settings)
        file = image_to_upload(read, out, seed=seed) if image is None else given_image(image)
    else:
        file = write_firmware(read, out, seed=seed).sketch
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
    if as_json:
        print_json({"command": command, "port": found, "image": str(file), "uploaded": not dry_run})
    elif dry_run:
        say(shlex.join(command))
    else:
        say(f"uploaded  {file} to {found}; the board starts within 3 s")


def _copy_image(chip: ArduinoProgram, image: Path, drive: str | None, *, is_dry: bool, as_json: bool) -> None:
    """Copy a UF2 file to the board's drive; `drive` is the folder of the drive, or None to find it."""
    from optopad.fabrication.flash import boot_drive, copy_uf2, mounted_drives, require_uf2

    require_uf2(chip, image)
    found = boot_drive(chip, mounted_drives() if drive is None else [Path(drive)])
    command = ["cp", str(image), str(found)]
    if not is_dry:
        copy_uf2(image, found)
    if as_json:
        print_json(
            {
                "command": command,
                "port": str(found),
                "image": str(image),
                "uploaded": not is_dry,
            }
        )
    elif is_dry:
        say(shlex.join(command))
    else:
        say(f"uploaded  {image} to {found}; the board starts within 3 s")


def _found_port(board: BoardSetup, *, is_agreed: bool, may_ask: bool) -> str:
    """Name of the board's port, found by the USB identity.

    A port that is identified only by a common serial chip needs the user's consent (`is_agreed`, or a question if
    `may_ask`).
    """
    from optopad.fabrication.driver.link.ports import GUESSED, find_port, is_guess

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


def _share(taken_bytes: int, of_bytes: int) -> str:
    return f"{taken_bytes} bytes ({taken_bytes / of_bytes:.0%})"

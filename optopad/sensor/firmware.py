"""Writes the firmware into the bundle: the sketch folder, and the compiled image if there is a compiler."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from optopad.design.errors import DeviceError, InputError
from optopad.design.files import read_bytes
from optopad.design.io import write_text_atomically
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.fabrication.flash import MOST_IMAGE_BYTES, Image, compiled_image
from optopad.fabrication.sketch import IMAGE, SKETCH, write_sketch

if TYPE_CHECKING:
    from optopad.fabrication.driver_file import BoardSetup

FIRMWARE = Path("fabrication") / "firmware"


@dataclass(frozen=True, kw_only=True)
class FirmwareFiles:
    """The written files of a firmware.

    Attributes
    ----------
    sketch : folder that the Arduino IDE opens
    image_file, image : the compiled program; None if it could not be compiled
    no_image_because : the reason in that case, else ""
    """

    sketch: Path
    image_file: Path | None
    image: Image | None
    no_image_because: str


def write_firmware(design: SensorDesign, out: Path, *, seed: int) -> FirmwareFiles:
    """Write the sketch folder into the design's bundle, and the image if it can be compiled.

    Raises
    ------
    DesignError : the design breaks a rule, or its board's entry lacks data for programming it.
    OutputError : the folder cannot be written.
    """
    require_valid(design)
    image, reason = _image(design)
    with bundle(design, out, seed=seed) as folder:
        write_sketch(design, folder / FIRMWARE)
        if image is not None:
            write_text_atomically(folder / FIRMWARE / IMAGE, image.hex_text)
    written = out / bundle_name(design) / FIRMWARE
    file = written / IMAGE
    return FirmwareFiles(
        sketch=written / SKETCH,
        image_file=file if file.is_file() else None,
        image=image,
        no_image_because=reason,
    )


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
    from optopad.fabrication.driver_config import driver_config

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


def _image(design: SensorDesign) -> tuple[Image | None, str]:
    try:
        return compiled_image(design), ""
    except DeviceError as err:
        return None, str(err)

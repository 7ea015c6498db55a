"""Writes the firmware into the bundle: the sketch folder, and the compiled image if there is a compiler."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from optopad.cli.verb import verb
from optopad.design.errors import DeviceError
from optopad.design.io import write_text_atomically
from optopad.design.pad import Pad
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.fabrication.flash import Image, compiled_image
from optopad.fabrication.sketch import IMAGE, SKETCH, FirmwareSettings, firmware_settings, write_sketch
from optopad.screen.output import Told
from optopad.work import OUT

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


@verb()
def firmware(design: SensorDesign, *, out: Path = Path(OUT), seed: int = 0) -> Told:
    """Write the sketch folder of a design for the Arduino IDE, and a .hex file if avr-gcc is installed."""
    settings, files = firmware_settings(Pad.of(design)), write_firmware(design, out, seed=seed)
    image, chip = files.image, settings.chip
    document = {
        "sketch": str(files.sketch),
        "board": chip.arduino_board,
        "image": None if files.image_file is None else str(files.image_file),
        "no_image_because": files.no_image_because,
        "flash_bytes": None if image is None else image.flash_bytes,
        "ram_bytes": None if image is None else image.ram_bytes,
        "config_crc": settings.config_crc(),
    }
    lines = [f"sketch    {files.sketch}", f"board     {settings.board_title} ({chip.arduino_board})"]
    if image is None:
        return Told(document, [*lines, f"no .hex   {files.no_image_because}"])
    takes = (
        f"takes     {_share(image.flash_bytes, chip.flash_bytes)} of program memory, "
        f"{_share(image.ram_bytes, chip.ram_bytes)} of RAM"
    )
    return Told(document, [*lines, f"image     {files.image_file}", takes])


def _share(taken_bytes: int, of_bytes: int) -> str:
    return f"{taken_bytes} bytes ({taken_bytes / of_bytes:.0%})"


def write_firmware(design: SensorDesign, out: Path, *, seed: int) -> FirmwareFiles:
    """Write the sketch folder into the design's bundle, and the image if it can be compiled.

    Raises
    ------
    DesignError : the design breaks a rule, or its board's entry lacks data for programming it.
    OutputError : the folder cannot be written.
    """
    settings = firmware_settings(Pad.of(design))
    image, reason = _image(settings)
    with bundle(design, out, seed=seed) as folder:
        write_sketch(settings, folder / FIRMWARE)
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


def _image(settings: FirmwareSettings) -> tuple[Image | None, str]:
    try:
        return compiled_image(settings), ""
    except DeviceError as err:
        return None, str(err)

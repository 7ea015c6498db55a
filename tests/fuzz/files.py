"""Trials of damaged files: the readers behind the verbs, and the verbs themselves where a reader refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np

from optopad.design.preset import preset
from tests.fuzz.bad_files import damage
from tests.fuzz.good_files import PAD, write_good_files
from tests.fuzz.trial import Outcome, command, tried

LONGEST_READ_S = 5.0
"""Processor time of reading a file: the first one of a process pays for the libraries' imports as well."""
COMMAND_EVERY = 4


def file_trial(seed: int, number: int, folder: Path) -> Outcome:
    """The outcome of one damaged file, the same for a seed and number."""
    good = folder / "good"
    if not good.is_dir():
        good.mkdir()
        write_good_files(good)
    chance = Random(f"file {seed} {number}")
    kinds = sorted(READERS)
    name = kinds[number % len(kinds)]
    file = folder / name
    shutil.copy(good / name, file)
    how = damage(file, chance)
    read, verb = READERS[name]
    found = tried(f"file {number}", lambda: read(file), longest_s=LONGEST_READ_S)
    if (
        found.is_refused
        and not found.failure
        and verb is not None
        and number // len(kinds) % COMMAND_EVERY == 0
    ):
        found = tried(
            f"file {number}", lambda: command(verb(file), refused=True), longest_s=2.0 * LONGEST_READ_S
        )
    return found if not found.failure else _with_kind(found, f"{name}, {how}")


def _with_kind(found: Outcome, kind: str) -> Outcome:
    return Outcome(
        what=found.what,
        seconds=found.seconds,
        message_bytes=found.message_bytes,
        is_refused=found.is_refused,
        failure=f"({kind}) {found.failure}",
    )


def _model(file: Path) -> list[str]:
    from optopad.sims.learning.inference.model_file import load_model

    model = load_model(file)
    with np.errstate(all="ignore"):
        model.predict(np.random.default_rng(5).uniform(80.0, 220.0, (3, len(model.header.untouched_counts))))
    return []


def _data(file: Path) -> list[str]:
    from optopad.sims.readings.dataset import read_data, require_design
    from optopad.sims.readings.press_data import clipped_note, joined

    data = joined([read_data(file)])
    clipped_note(data.role("train"))
    data.features()
    return list(require_design(data, preset(PAD)))


def _recorded(file: Path) -> list[str]:
    from optopad.sims.readings.recording import read_recording

    return list(read_recording(file).notes)


def _driver_file(file: Path) -> list[str]:
    from optopad.fabrication.driver.descriptor import descriptor_of
    from optopad.fabrication.driver.simulated.press_table import gains_of, untouched_table
    from optopad.fabrication.driver_file import load_driver_config

    config = load_driver_config(file)
    descriptor_of(config)
    gains_of(config)
    untouched_table(config)
    return []


def _raw(file: Path) -> list[str]:
    from optopad.fabrication.driver.recording.export import dataset_of, read_recorded

    dataset_of(read_recorded(file), file.name)
    return []


def _signals(file: Path) -> list[str]:
    from optopad.fabrication.driver.simulated.press_table import table_from_signals
    from tests.fabrication.driver.made_up_pad import pad_config

    table_from_signals(file, pad_config())
    return []


def _space(file: Path) -> list[str]:
    from optopad.design.search.space import load_space

    load_space(file)
    return []


def _protocol(file: Path) -> list[str]:
    from optopad.design.press_protocol import load_protocol_file

    load_protocol_file(file).fitted_to(preset(PAD)).places_mm(preset(PAD))
    return []


Read = Callable[[Path], list[str]]
Verb = Callable[[Path], list[str]] | None


def _with_model(file: Path) -> list[str]:
    return ["evaluate", str(file.parent / "good" / "data.nc"), "--model", str(file)]


READERS: dict[str, tuple[Read, Verb]] = {
    "kernel-ridge.optomodel": (_model, _with_model),
    "extra-trees.optomodel": (_model, lambda file: ["driver", "read", PAD, "--model", str(file)]),
    "signal-map.optomodel": (_model, _with_model),
    "data.nc": (_data, lambda file: ["train", str(file), "--design", PAD, "--out", str(file.parent)]),
    "recording.nc": (_recorded, lambda file: ["compare", PAD, str(file), "--out", str(file.parent)]),
    "signals.nc": (_signals, None),
    "driver.toml": (_driver_file, lambda file: ["driver", "read", str(file), "--port", "none"]),
    **{
        name: (_raw, lambda file: ["driver", "export", str(file), "--out", str(file.with_suffix(".nc"))])
        for name in ("raw.optorec", "bag.mcap")
    },
    "spaces.toml": (_space, lambda file: ["explore", str(file), "--out", str(file.parent)]),
    "protocols.toml": (
        _protocol,
        lambda file: ["simulate", PAD, "--protocol", str(file), "--fit", "--out", str(file.parent)],
    ),
}
"""File of `write_good_files` -> its reader, and the arguments of a verb that must refuse it where the reader did."""

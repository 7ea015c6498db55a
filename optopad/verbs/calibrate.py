"""Calibration: fits a design to a recording of its manufactured pad, and makes a model that reads this pad.

The clock of a load cell's log is matched to that of the recording, from the touches in both. A touch in the log is
where the force is above its baseline. The baseline follows the tare's drift: it is the opening of the force (a running
least value, then a running largest one) over a time longer than any press. The baseline and the threshold shift begin
and end of a touch by some tens of milliseconds, and by more if the tip retracts at another speed than it approaches. So
this match is only the first estimate: `optopad.sims.learning.force_fit` fits offset and rate with the force.

If the clocks run at different rates, the match is tried at rates up to `LARGEST_RATE`, and a straight line through the
lags of all begins and ends gives the rate. Left out: clocks that are set during the recording.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from optopad.cli.verb import named, parsed_offset, require_folder, typed, verb
from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.file_sets import written_together
from optopad.design.io import save_design, write_text_atomically
from optopad.design.netcdf_file import read_netcdf
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.recording.force_log import ForceLog, read_force_log
from optopad.fabrication.driver.recording.joined_log import (
    OUT_OF_STEP_S,
    WINDOW_S,
    ClockMatch,
    Offset,
    Touches,
    found_offset,
    match_at,
    measured_s,
)
from optopad.fabrication.driver.recording.recorded import require_rising
from optopad.screen.training import CalibratedBuild
from optopad.sims.learning.calibration import Calibration, calibrated, report_of
from optopad.sims.learning.force_checks import require_motion
from optopad.sims.learning.force_fit import fit_force
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.map_learner import fit_signal_map, map_header, mapped
from optopad.sims.learning.press_force import TipPath
from optopad.sims.readings.dataset import read_data, require_design
from optopad.sims.readings.press_data import PressData, data_notes, left_out_note
from optopad.work import as_netcdf

if TYPE_CHECKING:
    import xarray as xr

TOUCHED_SHARE, TOUCHED_SIGMAS = 0.02, 8.0
"""A touch is above this share of the largest force, and above this many standard deviations of the noise [-]."""
LONGER, LONGER_S = 1.2, 0.5
"""The opening is longer than the longest press by this factor and this time [-, s]."""
LARGEST_RATE = 0.015
"""Largest difference of the two clocks' rates that is searched [-]."""
RATE_LAG_S = 0.2
"""Lag that two neighbouring rates of the search differ by over the span of the search [s]."""
SEARCHED_S = 400.0
"""The rate is first found from presses of this span [s]."""
LEAST_LAGS = 6


@dataclass(frozen=True, kw_only=True)
class ForceClock:
    """Time by the recording's clock of a log's time T: T + offset_s + rate (T - pivot_s) [s]."""

    offset_s: float
    rate: float = 0.0
    pivot_s: float = 0.0

    def at(self, log_s: FloatArray) -> FloatArray:
        """Times by the recording's clock [s] of times by the log's [s]."""
        found: FloatArray = log_s + self.offset_s + self.rate * (log_s - self.pivot_s)
        return found


def force_clock(path: TipPath, log: ForceLog, offset: Offset) -> ForceClock:
    """Clock of a load cell's log, found or as it is given.

    Raises
    ------
    InputError : log and recording have no time in common, or their presses do not match; with the cause if it is known.
    """
    begin_s, end_s = path.touches_s
    pressed = Touches(begin_s=begin_s, end_s=end_s, span_s=(float(path.time_s[0]), float(path.time_s[-1])))
    forces = touches_of_force(log.time_s, log.force_n, _longest_s(pressed))
    if offset == "auto":
        return _found(pressed, forces, log)
    shift = float(offset or 0.0)
    first, last = forces.span_s
    begin, end = pressed.span_s
    if last + shift < begin or first + shift > end:
        raise InputError(
            f"{log.file}: no time in common with the recording: the presses last from 0 to {end - begin:.1f} s, "
            f"the log from {first + shift - begin:.1f} to {last + shift - begin:.1f} s; is it another run's log, or "
            "another clock? Find the offset with --offset auto, or give it"
        )
    match = match_at(pressed, forces, shift)
    if offset is None and match.edges and not (match.is_good and abs(match.offset_s) <= OUT_OF_STEP_S):
        _require_sign(pressed, log, shift)
        raise InputError(
            f"{log.file}: is out of step with the recording: {match.share:.0%} of {match.edges} begins and ends of "
            f"presses match, {match.offset_s:+.2f} s late; find the offset with --offset auto, or state it: --offset 0 "
            "takes the log unchanged"
        )
    return ForceClock(offset_s=shift)


def touches_of_force(time_s: FloatArray, force_n: FloatArray, longest_s: float) -> Touches:
    """Touches in a force log: where the force is above its baseline.

    Parameters
    ----------
    time_s, force_n : (n,) times in increasing order [s], and force, positive when pressed [N]
    longest_s : duration of the longest press [s]
    """
    step_s = float(np.median(np.diff(time_s)))
    grid = np.arange(time_s[0], time_s[-1], max(step_s, (time_s[-1] - time_s[0]) / 1e6))
    window = int((LONGER * longest_s + LONGER_S) / step_s) + 1
    half = min(window, len(grid)) // 2
    baseline = -_running_least(-_running_least(np.interp(grid, time_s, force_n), half), half)
    above = force_n - np.interp(time_s, grid, baseline)
    above -= np.quantile(above, 0.1)
    noise = 1.4826 * float(np.median(np.abs(np.diff(force_n)))) / np.sqrt(2.0)
    level = max(TOUCHED_SHARE * float(above.max()), min(TOUCHED_SIGMAS * noise, 0.5 * float(above.max())))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above > level / 2, [False]]).astype(np.int8)))
    parts = [(begin, end) for begin, end in edges.reshape(-1, 2) if above[begin:end].max() > level]
    begins = [_crossing_s(time_s, above, begin - 1, level / 2) for begin, _ in parts if begin > 0]
    ends = [_crossing_s(time_s, above, end - 1, level / 2) for _, end in parts if end < len(above)]
    return Touches(
        begin_s=np.array(begins), end_s=np.array(ends), span_s=(float(time_s[0]), float(time_s[-1]))
    )


def _running_least(values: FloatArray, half: int) -> FloatArray:
    """(n,) least of the values within `half` places on either side, by spans that double."""
    size, span, least = 2 * half + 1, 1, np.pad(values, half, mode="edge")
    while 2 * span <= size:
        least, span = np.minimum(least[:-span], least[span:]), 2 * span
    rest = size - span
    return np.minimum(least[: len(least) - rest], least[rest:])


def _crossing_s(time_s: FloatArray, values: FloatArray, k: int, level: float) -> float:
    share = (level - values[k]) / (values[k + 1] - values[k])
    return float(time_s[k] + share * (time_s[k + 1] - time_s[k]))


def _longest_s(touches: Touches) -> float:
    after = np.searchsorted(touches.end_s, touches.begin_s)
    inside = after < len(touches.end_s)
    spans = touches.end_s[after[inside]] - touches.begin_s[inside]
    return float(spans.max()) if spans.size else LONGER_S


def _require_sign(pressed: Touches, log: ForceLog, shift: float | None) -> None:
    """Refuse a log whose negated force matches the presses: at a shift [s], or at any if it is None."""
    negated = touches_of_force(log.time_s, -log.force_n, _longest_s(pressed))
    if shift is None:
        matches = _at_other_rates(pressed, negated) is not None
    else:
        matches = match_at(pressed, negated, shift).is_good
    if matches:
        raise InputError(
            f"{log.file}: the force is negative when the tip presses, as only the negated log matches the presses; it "
            "must be positive: negate the column"
        )


def _found(pressed: Touches, forces: Touches, log: ForceLog) -> ForceClock:
    try:
        return _lined_up(pressed, forces, 0.0, found_offset(pressed, forces))
    except InputError as err:
        found = _at_other_rates(pressed, forces)
        if found is None:
            _require_sign(pressed, log, None)
            raise InputError(f"{log.file}: {err}") from err
        return found


def _at_other_rates(pressed: Touches, forces: Touches) -> ForceClock | None:
    """The clock at the rate whose match is best, 0 among them; None if none matches."""
    part = _first(pressed, SEARCHED_S)
    span_s = min(part.span_s[1] - part.span_s[0], forces.span_s[1] - forces.span_s[0])
    step = RATE_LAG_S / span_s
    count = int(LARGEST_RATE / step)
    found: list[tuple[float, ClockMatch]] = []
    for rate in step * np.arange(-count, count + 1):
        try:
            found.append((float(rate), found_offset(part, _stretched(forces, float(rate)))))
        except InputError:
            continue
    if not found:
        return None
    rate, match = min(found, key=lambda one: (round(-one[1].share, 1), one[1].spread_s))
    return _lined_up(pressed, forces, rate, match)


def _first(touches: Touches, span_s: float) -> Touches:
    last = min(touches.span_s[0] + span_s, touches.span_s[1])
    return replace(
        touches,
        begin_s=touches.begin_s[touches.begin_s < last],
        end_s=touches.end_s[touches.end_s < last],
        span_s=(touches.span_s[0], last),
    )


def _stretched(touches: Touches, rate: float) -> Touches:
    """Touches by a clock that is faster by a rate [-], from the beginning of their span on."""
    first = touches.span_s[0]
    begin, end, span = (
        first + (1.0 + rate) * (np.asarray(times) - first)
        for times in (touches.begin_s, touches.end_s, touches.span_s)
    )
    return Touches(begin_s=begin, end_s=end, span_s=(float(span[0]), float(span[1])))


def _lined_up(pressed: Touches, forces: Touches, rate: float, match: ClockMatch) -> ForceClock:
    """The clock after a straight line through the lags of begins and ends, over ever longer spans."""
    pivot, offset = forces.span_s[0], match.offset_s
    span_s = SEARCHED_S
    while True:
        clock = ForceClock(offset_s=offset, rate=rate, pivot_s=pivot)
        change = _line(pressed, forces, clock, span_s)
        offset, rate = offset + change[0], rate + change[1]
        if span_s >= forces.span_s[1] - forces.span_s[0]:
            return ForceClock(offset_s=offset, rate=rate, pivot_s=pivot)
        span_s *= 2.0


def _line(pressed: Touches, forces: Touches, clock: ForceClock, span_s: float) -> tuple[float, float]:
    """Changes of offset [s] and rate [-] that the lags within a span from the first common touch on ask for."""
    first = max(pressed.span_s[0], float(clock.at(np.array([forces.span_s[0]]))[0]))
    rows, lags = [], []
    for kind, (seen, said) in enumerate(((pressed.begin_s, forces.begin_s), (pressed.end_s, forces.end_s))):
        if not seen.size or not said.size:
            continue
        lag = seen - clock.at(said)[:, None]
        nearest = np.abs(lag).argmin(axis=1)
        lag = lag[np.arange(len(said)), nearest]
        near = (np.abs(lag) < WINDOW_S) & (seen[nearest] < first + span_s)
        rows.append(
            np.stack(
                [np.full(near.sum(), kind == 0), np.full(near.sum(), kind == 1), said[near] - clock.pivot_s],
                1,
            )
        )
        lags.append(lag[near])
    matrix, lag = np.concatenate([*rows, np.zeros((0, 3))]), np.concatenate([*lags, np.zeros(0)])
    kept = np.ones(len(lag), dtype=bool)
    found = np.zeros(3)
    for _ in range(3):
        if kept.sum() < LEAST_LAGS:
            return 0.0, 0.0
        found = np.linalg.lstsq(matrix[kept], lag[kept], rcond=None)[0]
        rest = np.abs(lag - matrix @ found)
        kept = rest <= 3.0 * 1.4826 * np.median(rest[kept]) + 1e-6
    return float(found[:2].mean()), float(found[2])


MOST_BYTES = 2_000_000_000
"""Largest unpacked size of a recording whose presses are read [bytes]."""
FRAMES = ("host_time", "press_x", "press_y", "press_depth")
BOARD = ("device_time", "connection")
MOVES = ("move_time", "move_x", "move_y", "move_depth")
MOVE_STEP_S = 0.05
"""Longest time between two positions of a moving tip [s]."""
MODEL_FILE = "build.optomodel"
"""File name of the model for the manufactured pad, in the folder of the calibrated design."""


@verb(
    data=typed("DATA"),
    force=typed("CSV"),
    out=typed("FOLDER", type=Path, callback=require_folder),
    set_before="out",
)
def calibrate(
    design: SensorDesign,
    data: Path,
    *,
    no_model: bool = False,
    quick: bool = False,
    force: Path | None = None,
    offset: str | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep = silent,
) -> CalibratedBuild:
    """Fit heights, LED size, reflectances, index and gains to presses of a built pad; writes its design and a model.

    Parameters
    ----------
    data : Recording of 10 to 50 presses of the built pad (.nc, .optorec, .mcap, bag).
    no_model : Only fit; do not trace the map for the pad's model.
    quick : A coarser map, in a third of the time.
    force : A load cell's log of these presses (time, force_n): also fit the modulus.
    out : Folder of the calibrated design; default: next to the data.

    Raises
    ------
    InputError : the data are of another design or have too few presses or untouched frames, nothing can be fitted, or
        the log of the force does not fit the recording.
    """
    file = named(data)
    folder = require_folder(out or file.with_name(f"{file.stem}-calibration"))
    shift = parsed_offset(offset)
    if offset is not None and force is None:
        raise InputError("--offset: shifts a load cell's log; give --force, too")
    made = fitted(
        design,
        file,
        with_model=not no_model,
        quick=quick,
        seed=seed,
        on_step=on_step,
        force=force,
        offset=shift,
        topics=(topic, press_topic),
    )
    files = write_calibration(made, folder)
    return replace(made, notes=(*made.notes, *_earlier_model_note(made, folder)), files=files)


def fitted(
    design: SensorDesign,
    file: Path,
    *,
    with_model: bool,
    quick: bool,
    seed: int,
    on_step: OnStep,
    force: Path | None = None,
    offset: Offset = None,
    topics: tuple[str | None, str | None] = (None, None),
) -> CalibratedBuild:
    """The fit of `calibrate`, and its model `with_model`; nothing is written."""
    with as_netcdf(file, *topics) as netcdf:
        whole = read_data(netcdf, design)
        data = whole.of_one_tip()
        if force is not None and data is not whole:
            raise InputError(
                f"--force: {whole.has_more.sum()} frames of {file} have two touches, and a load cell measures the sum "
                "of their forces; leave --force out, or drop these frames"
            )
        log = None if force is None else read_force_log(force)
        pressed = None if log is None else _pressed_force(netcdf, log, offset)
    notes = [*require_design(data, design, what=str(file)), *data_notes(data), *(log.notes if log else ())]
    if more := left_out_note(whole.has_more, "a design is fitted to single touches"):
        notes.append(more)
    fit = None if pressed is None else fit_force(design, *pressed, lambda share: on_step("force", share))
    found = calibrated(design, data, seed=seed, on_step=on_step)
    report = report_of(found)
    if fit is not None:
        found = replace(found, design=fit.applied(found.design))
    model = build_model(found, data, quick=quick, seed=seed, on_step=on_step) if with_model else None
    if model is not None and fit is not None and model.header.force_curve is not None:
        curve = replace(model.header.force_curve, relative_sigma=fit.relative_sigma)
        model = replace(model, header=replace(model.header, force_curve=curve))
    return CalibratedBuild(
        design=design, calibration=found, report=report, model=model, notes=tuple(notes), force=fit
    )


def _pressed_force(netcdf: Path, log: ForceLog, offset: Offset) -> tuple[FloatArray, TipPath, FloatArray]:
    """Times of the log within the recording, by the recording's clock, the tip's positions, and the forces.

    Raises
    ------
    InputError : the recording has no times or presses, has no time in common with the log, or they do not match.
    """
    dataset = read_netcdf(netcdf, needed="a recording with presses", most_bytes=MOST_BYTES)
    path = _moves(dataset) if MOVES[0] in dataset else _labelled(dataset, netcdf)
    time_s = force_clock(path, log, offset).at(log.time_s)
    inside = (time_s > path.time_s[0]) & (time_s < path.time_s[-1])
    return time_s[inside], path, log.force_n[inside]


def _labelled(dataset: xr.Dataset, netcdf: Path) -> TipPath:
    """The tip's positions at the frames of a recording; raises InputError if they do not show its motion.

    A frame has the time at which a stage's log was joined to it, and of frames with the same time the first is taken.
    """
    missing = [name for name in FRAMES if name not in dataset]
    if missing:
        raise InputError(
            f"{netcdf}: has no {missing[0]}, needs a recording of `driver record` with its presses"
        )
    host_s, *press = (np.asarray(dataset[name].values, dtype=np.float64) for name in FRAMES)
    require_rising(host_s)
    time_s = host_s
    board = [np.asarray(dataset[name].values, dtype=np.float64) for name in BOARD if name in dataset]
    if len(board) == len(BOARD) and all(
        one.shape == host_s.shape and np.isfinite(one).all() for one in board
    ):
        time_s = measured_s(host_s, board[0], board[1].astype(np.int64))
    rises = np.diff(time_s, prepend=-np.inf) > 0.0
    path = TipPath(time_s=time_s[rises], press_mm=np.stack(press, axis=1)[rises])
    require_motion(path)
    return path


def _moves(dataset: xr.Dataset) -> TipPath:
    """The tip's path that `driver collect` writes: its knots, and positions between those of a move.

    Stretches around a knot without a position remain unknown: no force is fitted to a press that begins or ends in one,
    and none within it counts as force at rest.
    """
    knots = np.stack([np.asarray(dataset[name].values, dtype=np.float64) for name in MOVES], axis=1)
    moves = (np.diff(knots[:, 1:], axis=0) != 0.0).any(axis=1) & np.isfinite(knots[1:] + knots[:-1]).all(
        axis=1
    )
    parts = np.where(moves, np.ceil(np.diff(knots[:, 0]) / MOVE_STEP_S), 1.0).astype(np.int64).clip(1)
    ends = np.concatenate([[0], np.cumsum(parts)])
    place = np.arange(ends[-1] + 1)
    row = np.interp(place, ends, np.arange(len(knots)))
    whole = np.stack([np.interp(row, np.arange(len(knots)), axis) for axis in knots.T], axis=1)
    known = np.isfinite(whole).all(axis=1)
    whole, part = whole[known], np.cumsum(~known)[known]
    rises = np.diff(whole[:, 0], prepend=-np.inf) > 0.0
    return TipPath(
        time_s=whole[rises, 0],
        press_mm=whole[rises, 1:],
        after_unknown=1 + np.flatnonzero(np.diff(part[rises])),
    )


def build_model(
    found: Calibration, data: PressData, *, quick: bool, seed: int, on_step: OnStep
) -> SignalMapModel:
    """Make the model that reads a calibrated pad: a map of the pad's signals over location and depth."""
    lightmap = mapped(found.design, quick=quick, seed=seed, on_step=on_step)
    header = map_header(found.design, data, lightmap, seed)
    return fit_signal_map(found.design, lightmap, header, data, seed=seed, on_step=on_step)


def write_calibration(made: CalibratedBuild, folder: Path) -> tuple[Path, ...]:
    """Write ``design.toml``, ``calibration.json`` and, if there is a model, ``build.optomodel``; return their paths."""
    names = ["design.toml", "calibration.json"]
    with written_together(folder) as hidden:
        save_design(made.calibration.design, hidden / names[0])
        facts = json.dumps(made.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(hidden / names[1], facts)
        if made.model is not None:
            names.append(MODEL_FILE)
            save_model(hidden / names[2], made.model)
    return tuple(folder / name for name in names)


def _earlier_model_note(made: CalibratedBuild, folder: Path) -> tuple[str, ...]:
    """A note that the model in the folder is from an earlier calibration; empty if this calibration made a model."""
    if made.model is not None or not (folder / MODEL_FILE).exists():
        return ()
    return (
        f"{folder / MODEL_FILE} is of an earlier calibration and does not match the present design.toml; "
        "calibrate without --no-model, or delete it",
    )

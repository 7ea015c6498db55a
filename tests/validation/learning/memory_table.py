"""What a pad keeps of a press, and what follows for touch and driver: docs/validation/memory.md.

    python -m tests.validation.learning.memory_table          (light of two quick predictions, then eight minutes)

`remodel_residue.csv` and `remodel_loops.csv` have figures of the REMODEL recordings (Vanvitelli-Robotics/REMODEL,
commit 23dc0f1, folder 04_DATA/01_SingleTaxel). They are computed from the files `*_step_01sec.mat` (press, 20 s hold,
release; 500 Hz) and `data_hyst_*.mat` (slow loops). The signal of a taxel is its voltage less the mean of 4 to 1 s
before the press. Its change is the mean of the last 4 s of the hold. A share at time t is the mean from 0.92 t to
1.08 t after the middle of the release, over that change. All taxels with a change above 0.05 V are in the table. A
loop's share is its area over displacement, over the area under the loading curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, least_squares

from optopad.design.arrays import FloatArray
from optopad.design.fields.packaged import data_quantities
from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.press_protocol import QUICK_PROTOCOL, load_protocol_file
from optopad.design.recordings import kept_share, signals_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.drift import DriftTracker
from optopad.sims.contact.load_protocol import StandardLinearSolid, loop_energy_mj, viscoelastic_load_n
from optopad.sims.learning.after_release import TOUCH_MM, FoundAgain, found_again
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.learners import EFFORTS, LEARNERS
from optopad.sims.learning.map_learner import signal_map_learner
from optopad.sims.readings.protocol import ProtocolCurves, draw, protocol_curves
from optopad.sims.readings.signal_chain import Remainder, chain_of
from tests.validation.contact.contact_table import markdown_table
from tests.validation.stored import Row, tables

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "validation" / "memory.md"
FOLDER = "tests/validation/learning"
RESIDUE, DECAY_S = 0.04, 1.0
SHOWN_S = (0.5, 1.5, 6.0)
PADS = ("gripper-teensy", "piacenza2017-pad")


def recorded() -> tuple[list[Row], FloatArray, FloatArray]:
    """Rows of the residues, their times [s], and their shares (row, time) [-]."""
    (rows,) = tables(f"{FOLDER}/remodel_residue.csv")
    names = [name for name in rows[0] if name.startswith("kept_")]
    shares = np.array([[float(row[name]) for name in names] for row in rows]) / 100.0
    return rows, np.array([float(name.split("_")[1]) for name in names]), shares


@dataclass(frozen=True)
class Law:
    """A law of the share that is kept: its logarithm at times [s], from the parameters' logarithms."""

    name: str
    log_share: Callable[[FloatArray, FloatArray], FloatArray]
    start: tuple[float, ...]

    def fitted(self, time_s: FloatArray, share: FloatArray) -> tuple[FloatArray, float]:
        """Parameters, and the misfit of the logarithm, root mean square [-]."""
        found = least_squares(
            lambda at: self.log_share(time_s, np.exp(at)) - np.log(share), np.log(self.start)
        )
        return np.exp(found.x), float(np.sqrt(np.mean(found.fun**2)))


HYPERBOLA = Law(
    "r / (1 + t / T)", lambda t, p: np.log(kept_share(t, residue=p[0], decay_s=p[1])), (0.04, 1.0)
)
LAWS = (
    HYPERBOLA,
    Law("r exp(-t / T)", lambda t, p: np.log(p[0]) - t / p[1], (0.03, 3.0)),
    Law("r t^-n", lambda t, p: np.log(p[0]) - p[1] * np.log(t), (0.02, 0.6)),
    Law(
        "r exp(-t / T) + s exp(-t / U)",
        lambda t, p: np.log(p[0] * np.exp(-t / p[1]) + p[2] * np.exp(-t / p[3])),
        (0.03, 0.6, 0.02, 5.0),
    ),
)


def loop_share(loop: Row, solid: StandardLinearSolid) -> float:
    """Area of a loop of force over that under its loading curve, at constant speeds in the recording's times [-]."""
    up_s, down_s = float(loop["up_s"]), float(loop["down_s"])
    up, down = np.linspace(0.0, 1.0, 2001), np.linspace(1.0, 0.0, 2001)[1:]
    depth = np.concatenate([up, down])
    time_s = np.concatenate([up * up_s, up_s + (1.0 - down) * down_s])
    load = viscoelastic_load_n(time_s, depth ** float(loop["force_exponent"]), solid)
    load = np.maximum(load, 0.0)
    return loop_energy_mj(depth, load) / loop_energy_mj(up, load[: len(up)])


def share_needed(loop: Row, time_constant_s: float) -> float:
    """Relaxed share of a standard linear solid with which its loop has the measured area [-]."""
    wanted = float(loop["force_loop_percent"]) / 100.0

    def off(share: float) -> float:
        return (
            loop_share(loop, StandardLinearSolid(relaxed_share=share, time_constant_s=time_constant_s))
            - wanted
        )

    return float(brentq(off, 1e-3, 0.99))


@dataclass(frozen=True, kw_only=True)
class Pad:
    """A pad with the light of a quick prediction, and models that were trained with its memory."""

    curves: ProtocolCurves
    models: dict[str, TouchModel]

    @property
    def design(self) -> SensorDesign:
        """The pad's design."""
        return self.curves.design


def trained(name: str) -> Pad:
    """A preset with a memory, and its models as `optopad predict --quick --learner all` trains them."""
    design = preset(name).with_(**{"noise.release_residue": RESIDUE, "noise.release_decay_s": DECAY_S})
    curves = protocol_curves(design, load_protocol_file(QUICK_PROTOCOL).fitted_to(design), is_coarse=True)
    train = draw(curves).role("train")
    learners = LEARNERS | {SIGNAL_MAP: signal_map_learner(design, quick=True)}
    models = {kind: fit(train, seed=0, settings=EFFORTS["quick"]) for kind, fit in learners.items()}
    return Pad(curves=curves, models=models)


REST_S, DOWN_S, HOLD_S, UP_S = 2.0, 0.2, 2.0, 0.1
"""The finger of the driver's frames: time before the press, of the way down, of the hold and of the way up [s]."""
AFTER_S = 30.0
WINDOW, FALSE_SHARE = 20, 0.05
STRONG_COUNTS = 40.0


@dataclass(frozen=True, kw_only=True)
class Followed:
    """What the driver made of a press and its residue.

    Attributes
    ----------
    false_s : time from the release to the first 20 frames of which the driver reports at most one as touched [s]
    held_s : time after the release during which the untouched signals are held [s]
    moved : largest relative change of an untouched signal from the release to the end, pairs above 40 counts [-]
    gain_steps : steps of gain that the tracker reported
    """

    false_s: float
    held_s: float
    moved: float
    gain_steps: int


def followed(pad: Pad, learner: str, place: int, residue: float) -> Followed:
    """Frames of a press at the board's rate, through the drift tracker and a model as in `TouchReader`."""
    curves, model = pad.curves, pad.models[learner]
    design, rate_hz = pad.design, pad.design.board.frame_rate_hz
    chain, deepest = chain_of(design, curves.readout), curves.protocol.deepest_mm
    rng = np.random.default_rng(64)
    turn = REST_S + DOWN_S + HOLD_S
    time_s = np.arange(0.0, turn + UP_S + AFTER_S, 1.0 / rate_hz)
    depth = np.interp(time_s, [REST_S, REST_S + DOWN_S, turn, turn + UP_S], [-0.5, deepest, deepest, -0.5])
    released = int(np.flatnonzero(depth > 0.0)[-1]) + 1
    number = np.array([place])
    left = Remainder(
        change=curves.curves.at(number, np.array([deepest]))[0] - curves.curves.untouched,
        released_s=float(time_s[released]),
    )
    noise = design.noise.model_copy(update={"release_residue": residue})
    flux = curves.curves.at(np.full(len(depth), place), depth)
    flux[released:] = left.added(flux[released:], time_s[released:], noise)
    frames = signals_of(chain.counts(flux, time_s, rng)).astype(np.float64)
    begun = int(REST_S / 2 * rate_hz)
    tracker = DriftTracker(frames[:begun], model.header.untouched_counts, full_scale=chain.full_scale_counts)
    flat, reported, held = (
        frames.reshape(len(frames), -1),
        np.zeros(len(frames), bool),
        np.zeros(len(frames), bool),
    )
    before = tracker.untouched.copy()
    for start in range(begun, len(frames), 16):
        rows = range(start, min(start + 16, len(frames)))
        said = model.predict(tracker.features(flat[rows.start : rows.stop])).is_touched
        for row, says_touch in zip(rows, said, strict=True):
            state = tracker.follow(float(time_s[row]), flat[row], bool(says_touch))
            reported[row], held[row] = bool(says_touch) and not state.is_gain_like, state.is_held
        if start <= released:
            before = tracker.untouched.copy()
    after = reported[released:]
    shares = np.convolve(after, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    strong = before > STRONG_COUNTS
    return Followed(
        false_s=float(np.argmax(shares <= FALSE_SHARE + 1e-9) / rate_hz),
        held_s=float(held[released:].sum() / rate_hz),
        moved=float(np.abs(tracker.untouched / before - 1.0)[strong].max()),
        gain_steps=tracker.gain_steps,
    )


LEARNER, LOCATIONS, RESIDUES = "kernel-ridge", 3, (0.0, RESIDUE, 0.07)

HEAD = """\
# What a pad keeps of a press

**Question.** A silicone comes back slowly. How much of a press is left in the signals after the release, and what does
it do to the next touch and to the driver's zero?

**Answer.** Recordings of another silicone keep {least:.1f} to {most:.1f} % of a press at 0.5 s, and {late_least:.1f} to
{late_most:.1f} % at 6 s. The law r / (1 + t / T) fits them within {misfit:.0f} %, in the median. With r = 0.04 and
T = 1 s, a touch of 0.2 mm is found again {soon:.1f} to {last:.1f} s after the deepest press, by pad and learner. At the
worst location the driver reports no false touch after {false:.1f} s. Its untouched signals move by {moved:.2f} % at
most in the half minute after a release, and by {noise:.2f} % without a memory.

## Method

- **Measured**: the REMODEL recordings (Vanvitelli-Robotics/REMODEL, commit 23dc0f1). The pad has 5 x 5 optical couplers
  below air cavities in a silicone of unknown grade. It was pressed by 1.5 to 1.8 mm within 0.1 s, held for 20 s and
  released. There are also three slow loops. It is no clear silicone, and light does not enter it.
  `tests/validation/learning/` has the figures that were taken from the recordings.
- **Model**: `noise.release_residue` and `noise.release_decay_s` ([the signal
  chain](../how-to/simulate-data-set.md#the-signal-chain)). The loops of force are those of `elastomer.viscoelastic`, a
  standard linear solid, pressed and released at constant speed in the recordings' times.
- **Touch**: `optopad predict --quick --learner all` on two presets with this memory. The models are trained with it.
- **Driver**: frames at the board's rate, with the design's noise. The finger stays for 2 s at the deepest press and
  leaves in 0.1 s. The drift tracker and a model follow as in `optopad.TouchReader`. The time of false touches is that
  to the first 20 frames with at most one reported touch. The untouched signals are those of pairs above 40 counts. The
  table has the worst of {locations} locations, with 30 s after each release.

## Figures

Share of the press that is left, in per cent. The band is that of `design/data/memory.toml`.

"""

MEANING = """\

## What it means

- **One law with two parameters is enough.** An exponential is too fast in the end. A power of time has no value at the
  release. Two exponentials follow closer and need four parameters.
- **The residue is wider than the press**: its share grows with the distance from the press. The model keeps the press's
  own pattern, so it has too little residue far away.
- **The standard linear solid has one time constant.** With the residue's second its slow loops are far too narrow.
  Loops of the measured area need a relaxed share of 0.09 to 0.16 at 10 to 30 s. Fit `elastomer.viscoelastic` to your
  own load cell, and keep the memory of light separate.
- **Light has no loop in the model**, the recordings' signals have one of a few per cent.
- **A pad that is pressed deep forgets later.** The paper's pad is pressed by 5 mm, `gripper-teensy` by 2.5 mm.
- **The driver's zero follows it.** False touches come from the model. The tracker neither takes the residue for a
  change of gain, nor learns it while it is as large as a light touch. What is left then moves the untouched signals by
  little. Drift is not tracked before.
- The driver's times are those of the worst location. The times to find a touch again are for all locations together.

Left out: the time of the hold, depth, temperature, presses before the last one, and slow retractions. The three presses
were all held for 20 s.

## Made by

`python -m tests.validation.learning.memory_table`: the light of two quick predictions, then eight minutes of one core.
"""


def model_share(time_s: float, residue: float = RESIDUE, decay_s: float = DECAY_S) -> float:
    """Share that the model keeps [%]."""
    return 100.0 * float(kept_share(np.array(time_s), residue=residue, decay_s=decay_s))


def residue_table() -> str:
    """Recorded shares at some times, and the model's."""
    rows, times, shares = recorded()
    own = np.array([float(row["distance_mm"]) == 0.0 for row in rows])
    at = [int(np.argmin(abs(times - one))) for one in SHOWN_S]
    percent = 100.0 * shares[:, at]
    residue, decay = data_quantities("memory.toml").values()
    body = [
        [f"recorded: pressed taxel {row['taxel']}", *[f"{one:.1f}" for one in line]]
        for row, line in zip(rows, percent, strict=True)
        if float(row["distance_mm"]) == 0.0
    ]
    for name, of in (("the three pressed ones", own), ("all of the three presses", own | ~own)):
        body.append(
            [f"recorded: {name}, least to most", *[f"{c.min():.1f} to {c.max():.1f}" for c in percent[of].T]]
        )
    body.append(["model: r = 0.04, T = 1 s", *[f"{model_share(one):.1f}" for one in SHOWN_S]])
    ends = [(residue.low or 0.0, decay.low or 0.0), (residue.high or 0.0, decay.high or 0.0)]
    band = [" to ".join(f"{model_share(one, *end):.1f}" for end in ends) for one in SHOWN_S]
    body.append(["model: band of silicones", *band])
    return markdown_table(["signal", *[f"{one:g} s" for one in SHOWN_S]], body)


def law_table() -> str:
    """How well each law fits the recorded shares."""
    _, times, shares = recorded()
    body = []
    for law in LAWS:
        fits = [law.fitted(times, one) for one in shares]
        misfit = 100.0 * np.array([one for _, one in fits])
        body.append(
            [
                law.name,
                str(len(law.start)),
                f"{np.median(misfit):.0f}",
                f"{misfit.min():.0f} to {misfit.max():.0f}",
            ]
        )
    return markdown_table(["law", "parameters", "misfit %: median", "of the 23 signals"], body)


def distance_table() -> str:
    """Parameters of the law by the distance from the press."""
    rows, times, shares = recorded()
    fits = np.array([HYPERBOLA.fitted(times, one)[0] for one in shares])
    away = np.array([float(row["distance_mm"]) for row in rows])
    body = [
        [
            f"{one:.1f}",
            str((away == one).sum()),
            *[_span(fits[away == one, k], form) for k, form in ((0, ".3f"), (1, ".1f"))],
        ]
        for one in np.unique(away)
    ]
    return markdown_table(["distance from the press mm", "signals", "r", "T s"], body)


def _span(values: FloatArray, form: str) -> str:
    least, most = format(values.min(), form), format(values.max(), form)
    return least if least == most else f"{least} to {most}"


def loop_table() -> str:
    """Loops of force and signal, and the model's."""
    (loops,) = tables(f"{FOLDER}/remodel_loops.csv")
    solid = StandardLinearSolid(relaxed_share=RESIDUE, time_constant_s=DECAY_S)
    body = [
        [
            f"{loop['taxel']}, {loop['deepest_mm']} mm",
            loop["force_loop_percent"],
            f"{100.0 * loop_share(loop, solid):.1f}",
            *[f"{share_needed(loop, time_s):.2f}" for time_s in (1.0, 10.0, 30.0)],
            loop["change_loop_percent"],
            "0",
        ]
        for loop in loops
    ]
    head = ["taxel, depth", "force: area of the loop %", "model with 0.04 and 1 s %"]
    head += [f"share needed with {time_s} s" for time_s in (1, 10, 30)]
    return markdown_table([*head, "signal: area of the loop %", "model %"], body)


def found_table(found: dict[str, list[FoundAgain]]) -> str:
    """When each model finds a light touch again."""
    body = [
        [
            pad,
            f"{one.press_mm:g}",
            one.learner,
            f"{one.rested_found:.2f}",
            "-" if one.share is None else f"{100.0 * one.share:.1f}",
            *["-" if time_s is None else f"{time_s:.1f}" for time_s in (one.after_s, one.low_s, one.high_s)],
        ]
        for pad, all_of_pad in found.items()
        for one in all_of_pad
    ]
    head = [
        "pad",
        "press mm",
        "learner",
        "touches of 0.2 mm found on a rested pad",
        "bearable residue % of the press",
    ]
    return markdown_table([*head, "found again after s", "band: from s", "to s"], body)


def driver_table(found: dict[str, dict[float, list[Followed]]]) -> str:
    """What the driver makes of the residue, at the worst location."""
    body = [
        [
            f"{pad}, {preset(pad).board.frame_rate_hz:g} frames a second",
            f"{residue:g}",
            f"{1000.0 * max(one.false_s for one in runs):.0f}",
            f"{max(one.held_s for one in runs):.1f}",
            f"{100.0 * max(one.moved for one in runs):.2f}",
            str(max(one.gain_steps for one in runs)),
        ]
        for pad, by_residue in found.items()
        for residue, runs in by_residue.items()
    ]
    head = ["board", "residue", "false touches end after ms", "untouched signals are held for s"]
    return markdown_table([*head, "they move by at most %", "steps of gain"], body)


def page_text(found: dict[str, list[FoundAgain]], driver: dict[str, dict[float, list[Followed]]]) -> str:
    """The whole page."""
    _, times, shares = recorded()
    misfits = [HYPERBOLA.fitted(times, one)[1] for one in shares]
    first, end = (100.0 * shares[:, int(np.argmin(abs(times - one)))] for one in (0.5, 6.0))
    after = [one.after_s for all_of_pad in found.values() for one in all_of_pad if one.after_s is not None]
    kept = [one for by_residue in driver.values() for one in by_residue[RESIDUE]]
    free = [one for by_residue in driver.values() for one in by_residue[0.0]]
    head = HEAD.format(
        least=first.min(),
        most=first.max(),
        late_least=end.min(),
        late_most=end.max(),
        misfit=100.0 * float(np.median(misfits)),
        soon=min(after),
        last=max(after),
        false=max(one.false_s for one in kept),
        moved=100.0 * max(one.moved for one in kept),
        noise=100.0 * max(one.moved for one in free),
        locations=LOCATIONS,
    )
    parts = [
        residue_table(),
        "Laws, fitted from 0.5 to 6 s. The misfit is the root mean square of the logarithm.",
        law_table(),
        "The law's parameters by distance.",
        distance_table(),
        "Slow loops of 150 s: area of the loop over displacement, over the area under the loading curve.",
        loop_table(),
        f"Touches of {TOUCH_MM:g} mm after the deepest press at the same location.",
        found_table(found),
        f"The driver with the learner {LEARNER}. Without a memory, averages and guard of the tracker take the time.",
        driver_table(driver),
    ]
    return head + "\n\n".join(parts) + "\n" + MEANING


def main() -> None:
    """Make the page."""
    found, driver = {}, {}
    for name in PADS:
        pad = trained(name)
        found[name] = [found_again(pad.curves, model, learner=kind) for kind, model in pad.models.items()]
        places = next(
            places
            for one, places in zip(pad.curves.protocol.sets, pad.curves.place_of, strict=True)
            if one.role == "test"
        )
        driver[name] = {
            residue: [followed(pad, LEARNER, int(place), residue) for place in places[:LOCATIONS]]
            for residue in RESIDUES
        }
    write_text_atomically(PAGE, page_text(found, driver))


if __name__ == "__main__":
    main()

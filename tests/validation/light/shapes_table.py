"""Light of other pads than blocks against the oracle, pair by pair: `python -m tests.validation.light.shapes_table`.

Every preset of another shape, and two of them with receivers behind epoxy, untouched and under four presses, by the
engine's settings for maps, near contact and "standard". The oracle runs in batches, whose rays are the same with and
without a press: what the two differ by is far better known than either, and how batches differ tells how well. Batches
are kept in `FOLDER`; interrupted, it goes on.

Columns of the table
--------------------
- worst: the pair that is off most, in joint standard errors of the engine and of the oracle
- change: root mean square over pairs of how far the press's change is off, over the untouched signal, the oracle's own
  variance taken off; noise: the root of that variance
- finer: the same against the engine's own changes with much finer cells, another seed, and `FINER_PARTS` for parts of
  emitters, which no setting changes
- pairs: those with at least `DIM` of the brightest one's untouched signal; dimmer ones the oracle does not tell. All
  pairs that the oracle has seen count for the worst
"""

from __future__ import annotations

import sys
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import optopad
from optopad.design.arrays import FloatArray
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import ACCURACIES, MIRRORED_FINER, Accuracy
from optopad.sims.optics.engine.general import pad as formed_pad
from optopad.sims.optics.engine.trace_states import States, trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import (
    COSINE_NODES,
    OpticalScene,
    cosine_nodes,
    half_angle_power,
    refracted_cosine,
    transmitted_share,
)
from tests.oracle.pressed import pressed_tops
from tests.oracle.tracer import trace_oracle

EPOXY = ", receivers behind epoxy"
"""What comes after a preset's name where its receivers have a half angle of 40 degrees in epoxy of index 1.55."""
PADS = (
    *("levi2013-disc", "crowned-40x25", "fingertip-dome", "gripper-stadium"),
    *(f"levi2013-disc{EPOXY}", f"fingertip-dome{EPOXY}"),
)
SETTINGS: dict[str, Accuracy] = {
    "score": ACCURACIES["score"],
    "near contact": MIRRORED_FINER,
    "standard": ACCURACIES["standard"],
}
FINEST = replace(ACCURACIES["fine"], image_step=0.06)
FINER_PARTS = 0.04
RAYS, BATCHES = 100_000, 8
DIM = 0.02
FOLDER = Path("build/validation/shapes")
TABLE = Path(__file__).with_name("shapes_table.md")
HEAD = """# Light of discs and crowned pads against the oracle

Made by `python -m tests.validation.light.shapes_table`, which says what the columns are. In % of the untouched signal.

| pad | settings | press [mm] | worst [joint standard errors] | rms of these | change | noise | finer | stated error |
|---|---|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One state's comparison; shares of the untouched signal.

    Attributes
    ----------
    worst, spread : largest, and root mean square of, differences in joint standard errors
    change, noise, finer, stated : root mean squares over pairs that are not dim
    """

    worst: float
    spread: float
    change: float
    noise: float
    finer: float
    stated: float


def pad_of(name: str) -> tuple[SensorDesign, OpticalScene]:
    """A design and its scene, by one of `PADS`."""
    design = optopad.load(name.removesuffix(EPOXY))
    scene = scene_of(design)
    if name.endswith(EPOXY):
        power = half_angle_power(40.0, 1.55)
        inner = refracted_cosine(cosine_nodes(COSINE_NODES), scene.refractive_index, 1.55)
        counted = transmitted_share(cosine_nodes(COSINE_NODES), scene.refractive_index, 1.55) * inner**power
        scene = replace(scene, receiver_response=np.tile(counted, (len(scene.receiver_wall), 1)))
    return design, scene


def presses_of(design: SensorDesign) -> FloatArray:
    """(5, 3) x, y, depth [mm]: untouched, the middle, and two depths and the deepest beside it."""
    scene = scene_of(design)
    x, y = scene.length_mm / 2.0, scene.width_mm / 2.0
    away = 0.3 * min(scene.length_mm, scene.width_mm) / 2.0
    deepest = design.operating.max_depth_mm
    one, other = (x + away, y + 0.6 * away), (x - 1.2 * away, y + 0.7 * away)
    return np.array([[x, y, 0.0], [x, y, 1.0], [*one, 0.5], [*one, 2.0], [*other, deepest]])


def compared(
    engine: FloatArray, error: FloatArray, finest: FloatArray, batches: FloatArray, state: int, rays: int
) -> Compared:
    """One state of (state, e, r) flux and error of the engine, finest flux, and (batch, state, e, r) of the oracle."""
    count = len(batches)
    known, untouched = batches.mean(axis=0), engine[0]
    seen = known[state] > 0.0
    # rays that are counted: by the larger of both, as few counts that happen to be low would seem too certain
    counted = np.sqrt(np.maximum(known[state], engine[state]) / (rays * count))
    off = ((engine - known)[state] / np.hypot(error[state], counted))[seen]
    bright = untouched >= DIM * untouched.max()
    changes = batches[:, state] - batches[:, 0]
    change = (engine[state] - engine[0] - changes.mean(axis=0))[bright] / untouched[bright]
    finer = (engine[state] - engine[0] - finest[state] + finest[0])[bright] / untouched[bright]
    noise = float(np.mean(changes.var(axis=0, ddof=1)[bright] / count / untouched[bright] ** 2))
    return Compared(
        worst=float(np.abs(off).max()),
        spread=float(np.sqrt(np.mean(off**2))),
        change=float(np.sqrt(max(np.mean(change**2) - noise, 0.0))),
        noise=float(np.sqrt(noise)),
        finer=float(np.sqrt(np.mean(finer**2))),
        stated=float(np.sqrt(np.mean((error[state][bright] / untouched[bright]) ** 2))),
    )


def oracle_batches(
    name: str,
    scene: OpticalScene,
    places_mm: FloatArray,
    tops: States,
    rays: int,
    count: int,
) -> FloatArray:
    """(batch, state, e, r) light of the oracle that never left the elastomer; kept batches are read."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    heights = np.concatenate([np.ravel(one.height_mm) for one in tops if one is not None])
    surfaces, found = f"{zlib.crc32(heights.tobytes()):08x}", []
    for batch in range(count):
        file = FOLDER / f"{name}-{surfaces}-{rays}-{batch}.npy"
        if not file.exists():
            # each state alone, so that its rays are those of every other state
            lights = [
                trace_oracle(scene, [place], [top], rays=rays, seed=batch + 1).without_crossing[0]
                for place, top in zip(places_mm, tops, strict=True)
            ]
            np.save(file, np.array(lights))
        found.append(np.load(file))
    return np.array(found)


def finest_flux(scene: OpticalScene, presses: FloatArray, tops: States) -> FloatArray:
    """(state, e, r) light by the engine as fine as it goes."""
    usual = formed_pad.PART_SHARE, formed_pad.SPHERE_PART_SHARE
    formed_pad.PART_SHARE, formed_pad.SPHERE_PART_SHARE = FINER_PARTS, FINER_PARTS
    try:
        return trace_scene(scene, presses[:, :2], tops, accuracy=FINEST, seed=1).flux.sum(axis=0)
    finally:
        formed_pad.PART_SHARE, formed_pad.SPHERE_PART_SHARE = usual


def table(names: tuple[str, ...] = PADS, rays: int = RAYS, count: int = BATCHES) -> str:
    """The table as Markdown."""
    lines = []
    for name in names:
        design, scene = pad_of(name)
        presses = presses_of(design)
        tops = pressed_tops(design, presses, by_symmetry=False).near
        batches = oracle_batches(f"{name}-{design.digest[:8]}", scene, presses[:, :2], tops, rays, count)
        finest = finest_flux(scene, presses, tops)
        for title, settings in SETTINGS.items():
            light = trace_scene(scene, presses[:, :2], tops, accuracy=settings)
            for state, (x, y, depth) in enumerate(presses):
                row = compared(light.flux.sum(axis=0), light.standard_error, finest, batches, state, rays)
                place = f"{depth:g} at {x:.1f}, {y:.1f}" if state else "untouched"
                shares = (row.change, row.noise, row.finer, row.stated)
                lines.append(
                    f"| {name} | {title} | {place} | {row.worst:.1f} | {row.spread:.2f} | "
                    + " | ".join(f"{100.0 * share:.2f}" for share in shares)
                    + " |"
                )
    return HEAD + "\n".join(lines) + "\n"


def main(names: list[str]) -> None:
    """Write the table beside this file; of the named pads only, print it."""
    if names:
        sys.stdout.write(table(tuple(names)))
    else:
        TABLE.write_text(table(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

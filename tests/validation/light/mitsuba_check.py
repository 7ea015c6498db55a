"""The light engine against a forward walk in Mitsuba 3 on a mesh: docs/validation/mitsuba.md.

    python -m tests.validation.light.mitsuba_check  every state, a minute each; writes the tables of the page
    python -m tests.validation.light.mitsuba_check --floor  the states with parts on the floor alone, and their table
    python -m tests.validation.light.mitsuba_check --speed  one press, 8 million rays: what it counted and took, as JSON

Walks are kept in `FOLDER` by what they depend on: an interrupted table goes on, and after a change of the engine only
the engine runs. Mitsuba is optional (`pip install mitsuba`): `tests.validation.light.mitsuba_walk` says what it needs.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RectBivariateSpline

import optopad
from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.files import write_whole
from optopad.design.spec import SensorDesign
from optopad.sims.contact.pad_surface import pad_surface
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import (
    OpticalScene,
    SmoothField,
    cosine_nodes,
    half_angle_power,
    refracted_cosine,
    transmitted_share,
)
from optopad.sims.press import Indentation
from tests.bench.measures import surface_mesh
from tests.bench.measures.benchmark_states import DESIGN_FILE, different_walls
from tests.bench.measures.surface_mesh import TopMesh, compact_curve, pressed_mesh
from tests.oracle.pressed import pressed_tops
from tests.sims.optics.surface.analytic import compact_dimple
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.light.floor_table import PADS as FLOOR_PADS
from tests.validation.light.floor_table import design_of

if TYPE_CHECKING:
    from tests.validation.light.mitsuba_walk import Counted


PAGE = Path(__file__).parents[3] / "docs" / "validation" / "mitsuba.md"
FOLDER = Path("build/validation/mitsuba")
MARKS = "<!-- made by tests/validation/light/mitsuba_check.py -->", "<!-- end -->"
FLOOR_MARKS = "<!-- made by tests/validation/light/mitsuba_check.py: floor -->", "<!-- end of floor -->"
EPOXY = 40.0, 1.55
"""Half angle in air [deg] and index of the epoxy of receivers that are not bare."""
STEP_MM, COARSE_MM, BESIDE_STEP_MM = 0.05, 0.1, 0.08
"""Sides of triangles, and of the one coarser mesh; nodes of the height beside a press, 1 mm apart in the engine."""
RAYS = 1 << 24
SPEED_RAYS, SPEED_STEP_MM = 1 << 20, 0.4
FAINTEST = 100.0
"""Rays that a pair must have caught to be judged on its own."""
TOLD = 0.005
"""Standard error of the walk over a pair's untouched light, up to which its difference is told."""
BEYOND = 4.0
"""Largest pull of a right engine: with 16 launches chance alone exceeds it in one pair of 850."""
CLASSES = {"direct": [0], "mirrored": [1], "diffuse": [2], "all": [0, 1, 2]}


@dataclass(frozen=True, kw_only=True)
class State:
    """One press, or none.

    Attributes
    ----------
    name : of its files
    design : preset, the benchmark's file, or a pad of `tests.validation.light.floor_table`
    press : x, y, depth [mm]; depth 0 is untouched
    is_analytic : the surface is the compact dimple, else the contact model's
    has_epoxy : receivers lie behind epoxy
    """

    name: str
    design: str | Path
    press: tuple[float, float, float]
    is_analytic: bool = False
    has_epoxy: bool = False
    step_mm: float = STEP_MM

    @property
    def at_mm(self) -> tuple[float, float]:
        """Where the press goes in."""
        return self.press[:2]

    @property
    def loaded(self) -> SensorDesign:
        """Its design."""
        return design_of(str(self.design)) if self.design in FLOOR_PADS else optopad.load(self.design)

    def scene(self) -> OpticalScene:
        """Its scene."""
        scene = scene_of(self.loaded)
        if not self.has_epoxy:
            return scene
        (angle, epoxy), cosine, index = EPOXY, cosine_nodes(), scene.refractive_index
        inner = refracted_cosine(cosine, index, epoxy) ** half_angle_power(angle, epoxy)
        response = transmitted_share(cosine, index, epoxy) * inner
        return replace(scene, receiver_response=np.tile(response, (len(scene.receiver_wall), 1)))

    def engines_top(self) -> tuple[Indentation | None, SmoothField | None]:
        """The press and the field that the engine is given; only the curve where the scene has a form, as in `mesh`."""
        if self.is_analytic:
            return compact_dimple(self.press[2]), None
        tops = pressed_tops(self.loaded, np.array([self.press]), by_symmetry=False)
        return tops.near[0], None if self.scene().form is not None else tops.fields[0]

    def surface(self) -> tuple[Indentation | None, FloatArray | None]:
        """The press as the contact model gives it, and on a flat rectangle the height beside it [mm]."""
        scene = self.scene()
        if self.press[2] <= 0.0:
            return None, None
        if self.is_analytic:
            return compact_curve(compact_dimple(self.press[2]), scene.height_mm), None
        surface = pad_surface(self.loaded, self.press[2], self.at_mm)
        return surface.near, None if scene.form is not None else surface.beside_mm(*_grid(scene))

    def mesh(self, step_mm: float) -> TopMesh:
        """The top as triangles."""
        scene, (press, beside) = self.scene(), self.surface()
        spline = None if beside is None else RectBivariateSpline(*_grid(scene), beside)
        return pressed_mesh(scene, self.at_mm, press, spline, step_mm)


PAD, DISC, DOME, CROWN = "piacenza2017-pad", "levi2013-disc", "fingertip-dome", "crowned-40x25"
STATES = (
    State(name="analytic", design=DESIGN_FILE, press=(14.0, 17.0, 3.0), is_analytic=True),
    State(name="pad-deep", design=PAD, press=(12.0, 9.0, 3.9)),
    State(name="pad-deep-coarse", design=PAD, press=(12.0, 9.0, 3.9), step_mm=COARSE_MM),
    State(name="pad-corner", design=PAD, press=(6.0, 26.0, 2.0)),
    State(name="pad-wall", design=PAD, press=(16.0, 6.5, 3.0)),
    State(name="epoxy-untouched", design=PAD, press=(16.0, 16.0, 0.0), has_epoxy=True),
    State(name="epoxy-pressed", design=PAD, press=(6.0, 26.0, 1.0), has_epoxy=True),
    State(name="disc-untouched", design=DISC, press=(27.5, 27.5, 0.0)),
    State(name="disc-pressed", design=DISC, press=(34.209, 31.857, 2.5)),
    State(name="dome-untouched", design=DOME, press=(11.0, 11.0, 0.0)),
    State(name="dome-pressed", design=DOME, press=(13.5, 12.5, 2.0)),
    State(name="crown-untouched", design=CROWN, press=(20.0, 12.5, 0.0)),
    State(name="crown-pressed", design=CROWN, press=(26.0, 9.5, 2.0)),
)
FLOOR_STATES = (
    State(name="floor-bare", design="flat, bare", press=(19.0, 9.5, 2.0)),
    State(name="floor-specular", design="flat, specular 0.8", press=(19.0, 9.5, 2.0)),
    State(name="floor-diffuse", design="flat, receivers flush, diffuse 0.6", press=(19.0, 9.5, 2.0)),
    State(name="floor-level", design="disc, level, specular 0.8", press=(18.0, 11.5, 2.0)),
)


def _grid(scene: OpticalScene) -> tuple[FloatArray, FloatArray]:
    length, width = (
        np.linspace(0.0, size, int(np.ceil(size / BESIDE_STEP_MM)) + 1)
        for size in (scene.length_mm, scene.width_mm)
    )
    return length, width


def kept_file(state: State, number: int) -> Path:
    """Where the walk of a state is kept: the name holds a digest of what the walk depends on, its sources too."""
    press, beside = state.surface()
    sources = [Path(__file__).with_name("mitsuba_walk.py"), Path(str(surface_mesh.__file__))]
    texts = [source.read_text(encoding="utf-8") for source in sources]
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        content = repr((texts, state.scene(), press, state.at_mm, state.step_mm, RAYS, number)).encode()
    key = hashlib.blake2b(content, digest_size=6)
    key.update(b"" if beside is None else beside.tobytes())
    return FOLDER / f"{state.name}-{key.hexdigest()}.json"


def counted(state: State, number: int) -> Counted:
    """The walk of a state, read where it is kept."""
    from tests.validation.light.mitsuba_walk import Counted, pad, walk

    file = kept_file(state, number)
    if file.exists():
        kept = json.loads(file.read_text(encoding="utf-8"))
        return Counted(**(kept | {name: np.array(kept[name]) for name in ("flux", "square")}))
    given = pad(state.scene(), state.mesh(state.step_mm))
    found = walk(given, RAYS, number, threads=len(os.sched_getaffinity(0)))
    values = asdict(found) | {"flux": found.flux.tolist(), "square": found.square.tolist()}
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_whole(file, json.dumps(values).encode())
    return found


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One state, both ways.

    Attributes
    ----------
    engine : (3, e, r) light by class [-]
    walk : (launch, 3, e, r) likewise
    stated : (e, r) the engine's standard error [-]
    untouched : (e, r) light without a press [-]
    judged : (e, r) pairs on different walls, or with an emitter on the floor, that caught enough rays
    seconds : processor time of the walk
    """

    engine: FloatArray
    walk: FloatArray
    stated: FloatArray
    untouched: FloatArray
    judged: BoolArray
    seconds: float

    def of_pairs(self, classes: list[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(pair,) engine less walk over the untouched light, standard error of the walk, and pull by both errors."""
        off, error = _off(self.engine[classes].sum(axis=0), self.walk[:, classes].sum(axis=1))
        pull, untouched = off / np.maximum(np.hypot(error, self.stated), 1e-12), self.untouched
        return tuple(one[self.judged] for one in (off / untouched, error / untouched, pull))

    def of_all(self, classes: list[int]) -> tuple[float, float]:
        """Engine less walk, summed over judged pairs, over all their light, and the walk's standard error."""
        engine = self.engine[classes][:, self.judged].sum()
        off, error = _off(engine, self.walk[:, classes][:, :, self.judged].sum(axis=(1, 2)))
        total = self.walk[:, :, self.judged].sum(axis=(1, 2)).mean()
        return float(off / total), float(error / total)


def _off(engine: FloatArray, walk: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Engine less the mean of the walk's launches (the first axis), and the standard error of that mean."""
    return engine - walk.mean(axis=0), walk.std(axis=0, ddof=1) / np.sqrt(len(walk))


def compared(state: State, number: int) -> Compared:
    """The engine at its finest against the walk."""
    found, scene = counted(state, number), state.scene()
    press, field = state.engines_top()
    raw = trace_scene(
        scene,
        np.array([state.at_mm] * 2),
        [None, press],
        fields=None if field is None else [None, field],
        accuracy="fine",
        seed=7,
    )
    by_name = dict(zip(CLASS_NAMES, raw.flux[:, 1], strict=True))
    engine = np.stack(
        [by_name["direct"], by_name["top"] + by_name["skirt"], by_name["wall"] + by_name["diffuse"]]
    )
    return Compared(
        engine=engine,
        walk=found.flux,
        stated=raw.standard_error[1],
        untouched=raw.flux[:, 0].sum(axis=0),
        judged=(different_walls(scene) | (scene.emitter_wall < 0)[:, None])
        & (engine.sum(axis=0) * found.rays > FAINTEST),
        seconds=found.seconds,
    )


def signed(share: float, error: float) -> str:
    """A share and its standard error in %."""
    return f"{100.0 * share:+.3f} ± {100.0 * error:.3f}"


def row(state: State, found: Compared) -> tuple[list[str], list[str]]:
    """A line of the table, and pairs whose mirrored light is off: by `BEYOND` joint errors, or by `TOLD`."""
    names = [f"E{emitter + 1}-R{receiver + 1}" for emitter, receiver in np.argwhere(found.judged)]
    _, _, pulls = found.of_pairs(CLASSES["all"])
    off, error, mirrored = found.of_pairs(CLASSES["mirrored"])
    told = np.where(error < TOLD, np.abs(off), -1.0)
    largest, widest = int(np.abs(mirrored).argmax()), int(told.argmax())
    x, y, depth = state.press
    where = f"{depth:g} mm at ({x:g}, {y:g}) mm" if depth > 0.0 else "untouched"
    line = [
        state.name,
        where,
        str(len(names)),
        *(signed(*found.of_all(classes)) for classes in CLASSES.values()),
        *(f"{np.sqrt(np.mean(one**2)):.2f}" for one in (pulls, mirrored)),
        f"{names[largest]}: {mirrored[largest]:+.1f}",
        f"{names[widest]}: {signed(off[widest], error[widest])}" if told[widest] >= 0.0 else "-",
        f"{found.seconds:.0f}",
    ]
    is_off = (np.abs(mirrored) > BEYOND) | (np.abs(off) > np.maximum(TOLD, BEYOND * error))
    return line, [
        f"{names[k]} {signed(off[k], error[k])} ({mirrored[k]:+.1f})" for k in np.flatnonzero(is_off)
    ]


HEAD = [
    "state",
    "press",
    "pairs",
    *(f"{name} %" for name in CLASSES),
    "pull rms, all",
    "pull rms, mirrored",
    "largest pull, mirrored",
    "largest difference, mirrored %",
    "core-s of Mitsuba",
]


def main(arguments: list[str]) -> None:
    """Make the tables, or measure the speed."""
    if "--speed" in arguments:
        print(json.dumps(speed()))
        return
    if "--floor" not in arguments:
        _write(wall_table(), MARKS)
    _write(floor_table(), FLOOR_MARKS)


def _write(text: str, marks: tuple[str, str]) -> None:
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, marks), encoding="utf-8")


def _made() -> str:
    made = f"Made with mitsuba {version('mitsuba')} and drjit {version('drjit')}"
    return f"{made}, {RAYS / 1e6:.0f} million rays an emitter and state."


def floor_table() -> str:
    """The table of parts on the floor; its last column names the pairs whose mirrored light is off."""
    lines = []
    for number, state in enumerate(FLOOR_STATES, start=len(STATES) + 1):
        line, pairs = row(state, compared(state, number))
        lines.append([*line, ", ".join(pairs) or "none"])
        print(" | ".join(lines[-1]), flush=True)
    head = ["parts on the floor", *HEAD[1:], "mirrored light off, % of untouched (joint standard errors)"]
    return "\n\n".join([_made(), markdown_table(head, lines)])


def wall_table() -> str:
    """The table of parts in walls."""
    lines, beyond = [], []
    for number, state in enumerate(STATES):
        line, pairs = row(state, compared(state, number + 1))
        lines.append(line)
        beyond += [f"- `{state.name}`: {', '.join(pairs)}"] if pairs else []
        print(" | ".join(line), flush=True)
    return "\n\n".join(
        [
            _made(),
            markdown_table(HEAD, lines),
            "Pairs whose mirrored light is off, % of their untouched light (joint standard errors):",
            "\n".join(beyond or ["- none"]),
        ]
    )


def speed() -> dict[str, object]:
    """A walk by plain chance on a coarse mesh of the first state, as arguments of `Walked`."""
    from tests.validation.light.mitsuba_walk import pad, walk

    scene = STATES[0].scene()
    found = walk(pad(scene, STATES[0].mesh(SPEED_STEP_MM)), SPEED_RAYS, is_even=False)
    flux = found.flux.mean(axis=0).sum(axis=0)
    return {
        "flux": flux.tolist(),
        "variance": (found.square - flux**2).tolist(),
        "rays": found.rays,
        "segments": found.segments,
        "seconds": found.seconds,
    }


if __name__ == "__main__":
    main(sys.argv[1:])

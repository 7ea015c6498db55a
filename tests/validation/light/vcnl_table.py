"""Light of real reflective chips, with and without clear silicone: `python -m tests.validation.light.vcnl_table`.

The counts of 24 chips VCNL4040 around a fingertip are of 708yamaguchi/pr2_fingertip_sensors and its fork by nakane11
(`data/pfs_params.yaml` in the history of both; BSD by package.xml), as in `data/vcnl4040_elastomer.csv`. Two ratios are
free of the chips' gain:

- R1: what a bare layer of silicone returns, over what the white cover returns to a chip in air
- R2: what the white cover on the silicone returns, over the same

The counts of a chip in air with nothing near are light inside the chip. They are subtracted, as if silicone left them
unchanged.

The prediction is `tests.validation.light.vcnl_walk`. Nothing in it was fitted to the counts: `INPUTS` holds the values
that were taken before, each with its band. The engine is compared with the walk in scenes that it can express.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.fields.quantity import absorption_per_mm
from optopad.design.parts import catalog
from optopad.design.parts.catalog import Part
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import cosine_nodes, response_nodes
from tests.validation.contact.contact_table import markdown_table, write_tables
from tests.validation.light.vcnl_walk import Angular, Block, Pattern, received

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "board-light.md"
COUNTS = Path(__file__).with_name("data") / "vcnl4040_elastomer.csv"
MADE_BY = "tests/validation/light/vcnl_table.py"
APART, OFF = 2.6, 3.0
"""Distance of the chip's emitter and receiver; distance of the chip from its board's middle along x and y [mm]."""
AIR_DEG, AIR = (0.0, 10.0, 15.0, 20.0, 30.0), (1.0, 0.72, 0.5, 0.33, 0.1)
"""Angle [deg] and relative intensity of the emitter in air (data sheet); no light is assumed beyond `air_end_deg`."""


@dataclass(frozen=True)
class Input:
    """A value that the prediction takes, with the band that it is believed to be in."""

    value: float
    low: float
    high: float
    means: str


INPUTS = {
    "thickness": Input(3.0, 2.0, 4.0, "silicone over the chip's face, mm"),
    "distance": Input(3.0, 2.0, 4.0, "white cover over the face of a chip in air, mm"),
    "outline": Input(20.0, 12.0, 25.0, "side of the block, mm"),
    "board": Input(0.15, 0.05, 0.3, "reflectance of the board"),
    "cover": Input(0.9, 0.8, 0.95, "reflectance of the white cover"),
    "wetted": Input(52.8, 35.0, 65.0, "half angle of the emitter in silicone, deg"),
    "air_end": Input(60.0, 40.0, 90.0, "angle at which the emitter's light in air ends, deg"),
    "power": Input(1.1, 1.0, 1.5, "light of the emitter in silicone over that in air"),
    "emitter": Input(1.06, 0.3, 1.2, "width of the emitting face in silicone, mm"),
    "receiver": Input(0.97, 0.4, 1.1, "width of the receiving face, mm"),
    "half": Input(55.0, 50.0, 60.0, "half angle of the receiver in air, deg"),
    "index": Input(1.4, 1.39, 1.41, "refractive index of the silicone"),
    "loss": Input(0.5, 0.0, 1.2, "absorption of the silicone, dB/cm"),
}
"""What the prediction takes; the silicone is Sylgard 184 near 940 nm."""
NOMINAL = {name: one.value for name, one in INPUTS.items()}
RATIOS = ("R1", "R2 wet", "R2 gap", "R1 / R2 wet", "R1 / R2 gap")


# the counts


@dataclass(frozen=True, kw_only=True)
class Counts:
    """Counts of the 16 chips on the four equal boards of a finger.

    Attributes
    ----------
    nothing, white : (16,) counts with nothing near, and what the white cover adds
    """

    date: str
    finger: str
    state: str
    nothing: FloatArray
    white: FloatArray


@cache
def counts() -> tuple[Counts, ...]:
    """The sets of the table, by date; the front board, whose chips lie farther apart, is left out."""
    with COUNTS.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["board"] != "front"]
    keys = dict.fromkeys((row["date"], row["finger"], row["state"]) for row in rows)
    return tuple(
        Counts(
            date=key[0],
            finger=key[1],
            state=key[2],
            nothing=_column(rows, key, "counts_nothing_near"),
            white=_column(rows, key, "counts_white_minus_nothing"),
        )
        for key in keys
    )


def _column(rows: list[dict[str, str]], key: tuple[str, str, str], name: str) -> FloatArray:
    return np.array([float(row[name]) for row in rows if (row["date"], row["finger"], row["state"]) == key])


def in_air() -> tuple[float, float]:
    """Mean counts of the chips that are stated to be bare: nothing near, and what the cover adds."""
    bare = [one for one in counts() if one.state == "bare (stated)"]
    return (
        float(np.mean([one.nothing.mean() for one in bare])),
        float(np.mean([one.white.mean() for one in bare])),
    )


def measured() -> dict[str, dict[str, tuple[float, float]]]:
    """R1, R2 and R1 / R2 of each set under silicone, each with the spread of the 16 chips (standard deviation)."""
    inside, white = in_air()
    found = {}
    for one in counts():
        if one.state.startswith("elastomer"):
            added, covered = one.nothing - inside, one.nothing + one.white - inside
            ratios = {"R1": added / white, "R2": covered / white, "R1 / R2": added / covered}
            found[f"{one.finger}, {one.date}"] = {
                name: (float(values.mean()), float(values.std(ddof=1))) for name, values in ratios.items()
            }
    return found


def counts_table() -> str:
    """Means of the chips in each set, with the spread from chip to chip."""
    rows = [
        [
            one.finger,
            one.date,
            one.state,
            *(f"{v.mean():.0f} ± {v.std(ddof=1):.0f}" for v in (one.nothing, one.white)),
        ]
        for one in counts()
    ]
    return markdown_table(["finger", "date", "state", "nothing near", "white cover less nothing"], rows)


def measured_table() -> str:
    """The measured ratios, set by set."""
    rows = [
        [name, *(f"{mean:.2f} ± {spread:.2f}" for mean, spread in ratios.values())]
        for name, ratios in measured().items()
    ]
    return markdown_table(["finger, date", "R1", "R2", "R1 / R2"], rows)


# the prediction


def _part(name: str) -> Part:
    return catalog.packaged().parts[name]


def _response(half_angle_deg: float, index: float) -> Angular:
    """Counted share of the light by its cosine, as the product computes it from a half angle in air."""
    part = _part("vishay-vcnl4040-receiver")
    half = part.half_angle_deg.model_copy(update={"value": half_angle_deg, "low": None, "high": None})
    nodes = response_nodes(part.model_copy(update={"half_angle_deg": half}), index)
    return lambda cosine: np.interp(cosine, cosine_nodes(), nodes)


def block_of(given: Mapping[str, float], wall: float | None) -> Block:
    """The bare block of one set of inputs; `wall` is the reflectance of the sides, None for bare ones."""
    side, off = given["outline"], given["outline"] / 2 + OFF
    return Block(
        size=(side, side, given["thickness"]),
        index=given["index"],
        absorption=absorption_per_mm(given["loss"]),
        floor=given["board"],
        wall=wall,
        white=given["cover"],
        emitter=(off - APART / 2, off),
        receiver=(off + APART / 2, off),
        emitter_width=given["emitter"],
        receiver_width=given["receiver"],
    )


def predicted(
    given: Mapping[str, float], rays: int, seed: int, wall: float | None = None
) -> dict[str, float]:
    """The ratios of one set of inputs; `wall` is the reflectance of the sides, None for bare ones."""
    block = block_of(given, wall)
    lens = _part("vishay-vcnl4040-emitter").active_width_mm.value
    air = block.with_(
        size=(*block.size[:2], given["distance"]),
        index=1.0,
        absorption=0.0,
        cover="wet",
        wall=0.0,
        emitter_width=lens,
    )
    ends = np.array([*AIR_DEG, given["air_end"], 90.0 + 1e-9])
    in_air_pattern = Pattern.of_table(ends, np.array([*AIR, 0.0, 0.0]))
    whole, _, _ = received(air, in_air_pattern, _response(given["half"], 1.0), rays, seed)
    wetted, counted = Pattern.of_half_angle(given["wetted"]), _response(given["half"], given["index"])
    bare, wet, gap = (
        given["power"] * received(block.with_(cover=cover), wetted, counted, rays, seed)[0] / whole
        for cover in ("bare", "wet", "gap")
    )
    return dict(zip(RATIOS, (bare, wet, gap, bare / wet, bare / gap), strict=True))


RAYS, DRAWS, DRAWN_RAYS = 60_000, 200, 8_000


@cache
def drawn(draws: int = DRAWS, rays: int = DRAWN_RAYS) -> dict[str, FloatArray]:
    """(draws,) ratios with every input drawn evenly from its band at once (Latin hypercube)."""
    random = np.random.default_rng(67)
    steps = {name: (random.permutation(draws) + random.random(draws)) / draws for name in INPUTS}
    rows = [
        predicted(
            {name: one.low + (one.high - one.low) * steps[name][k] for name, one in INPUTS.items()}, rays, k
        )
        for k in range(draws)
    ]
    return {name: np.array([row[name] for row in rows]) for name in RATIOS}


def predicted_table() -> str:
    """Predicted ratios: nominal, over all bands, and next to the measured ones."""
    nominal, many = predicted(NOMINAL, RAYS, 1), drawn()
    found = list(measured().values())
    rows = []
    for name in RATIOS:
        low, high = np.quantile(many[name], (0.05, 0.95))
        own = [ratios[name.removesuffix(" wet").removesuffix(" gap")][0] for ratios in found]
        share = np.mean(many[name] >= min(own)), np.mean(many[name] > max(own))
        rows.append(
            [
                name,
                f"{min(own):.2f} to {max(own):.2f}",
                f"{nominal[name]:.3f}",
                f"{low:.3f} to {high:.3f}",
                f"{100.0 * share[0]:.0f}, {100.0 * share[1]:.0f}",
            ]
        )
    return markdown_table(
        [
            "ratio",
            "measured, three sets",
            "predicted, nominal",
            "predicted, 90 % of draws",
            "% of draws that reach the least, exceed the largest",
        ],
        rows,
    )


def inputs_table() -> str:
    """Every input with its band, and the ratios with this one at either end."""
    rows = [["all nominal", "", *_cells(predicted(NOMINAL, RAYS, 1))]]
    for name, one in INPUTS.items():
        for end in (one.low, one.high):
            rows.append(
                [
                    f"{one.means}: {one.value:g}",
                    f"{end:g}",
                    *_cells(predicted({**NOMINAL, name: end}, RAYS, 1)),
                ]
            )
    return markdown_table(["input: nominal", "instead", *RATIOS], rows)


OUTLINES = (10.0, 11.0, 12.0, 13.0, 15.0, 20.0)


def outlines_table() -> str:
    """R1 by the side of the block, for bare and for black sides."""
    heads = ["side of the block, mm", *(f"{one:g}" for one in OUTLINES)]
    rows = [
        [name, *(f"{predicted({**NOMINAL, 'outline': one}, RAYS, 1, wall)['R1']:.3f}" for one in OUTLINES)]
        for name, wall in (("R1, bare sides", None), ("R1, black sides (0.05)", 0.05))
    ]
    return markdown_table(heads, rows)


SCENES: dict[str, tuple[dict[str, float], float | None]] = {
    "nominal: bare sides": ({}, None),
    "black sides (0.05)": ({}, 0.05),
    "grey sides (0.5)": ({}, 0.5),
    "white board (0.8)": ({"board": 0.8}, None),
    "white board and white sides (0.8)": ({"board": 0.8}, 0.8),
}
"""Scenes outside the bands: what would have to be true for R1 to be met."""


def scenes_table() -> str:
    """The ratios in scenes outside the bands."""
    rows = [
        [name, *_cells(predicted({**NOMINAL, **changes}, RAYS, 1, wall))]
        for name, (changes, wall) in SCENES.items()
    ]
    return markdown_table(["scene", *RATIOS], rows)


def _cells(ratios: Mapping[str, float]) -> list[str]:
    return [f"{ratios[name]:.3f}" for name in RATIOS]


ORDERS_OF = (("nominal", 0.15, None), ("white board", 0.8, None), ("black sides", 0.15, 0.05))


def orders_table() -> str:
    """What a bare layer returns, by the number of times that the light was scattered before."""
    wetted = Pattern.of_half_angle(NOMINAL["wetted"])
    response = _response(NOMINAL["half"], NOMINAL["index"])
    rows = []
    for name, board, wall in ORDERS_OF:
        share, _, orders = received(block_of({**NOMINAL, "board": board}, wall), wetted, response, RAYS, 1)
        rows.append([name, *(f"{100.0 * part / share:.0f}" for part in (*orders[:3], orders[3:].sum()))])
    return markdown_table(["scene", "not scattered, %", "once, %", "twice, %", "more often, %"], rows)


# the engine


def one_chip(thickness: float, board: float, wall: float, cover: float | None) -> SensorDesign:
    """A pad with one VCNL4040 on its board, bare or under a white skin."""
    document: dict[str, Any] = preset("fingertip-16").model_dump(mode="json", exclude_none=True)
    side, at = NOMINAL["outline"], NOMINAL["outline"] / 2 + OFF
    document |= {"name": "one-chip", "description": "", "layout": []}
    document["cavity"] = {
        "length_mm": side,
        "width_mm": side,
        "clear_thickness_mm": thickness,
        "black_thickness_mm": _part("vishay-vcnl4040-emitter").body_depth_mm.value,
    }
    document["mold"] |= {"outer_length_mm": side + 12.0, "outer_width_mm": side + 12.0}
    document["surfaces"] |= {"wall_reflectance": wall, "bottom_reflectance": board}
    document["emitters"] = {"part": "vishay-vcnl4040-emitter"}
    document["receivers"] = {"part": "vishay-vcnl4040-receiver"}
    document["layout"] = [
        {"pattern": "single", "kind": kind, "wall": "floor", "x_mm": at + shift, "y_mm": at}
        for kind, shift in (("emitter", -APART / 2), ("receiver", APART / 2))
    ]
    document["operating"]["max_depth_mm"] = 0.5
    if cover is not None:
        document["top"] = {"finish": "diffuse", "reflectance": cover}
    return SensorDesign.from_document(document, where="one-chip")


ENGINE = tuple(
    (thickness, board, wall, cover)
    for thickness in (2.0, 3.0, 4.0)
    for board, wall in ((0.15, 0.05), (0.3, 0.5), (0.8, 0.05))
    for cover in (None, 0.9)
)
"""Scenes for both methods: thickness [mm], reflectances of board, sides and cover, None for a bare top."""


SEEDS = 16


def both(
    scene: tuple[float, float, float, float | None], rays: int, seeds: int = SEEDS
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Received share by the engine and by the walk, each with its standard error.

    The engine's is that of several seeds' mean, by their scatter: light that seldom meets the receiver makes the error
    that a single run states too small.
    """
    thickness, board, wall, cover = scene
    draft = Draft.of(one_chip(thickness, board, wall, cover))
    lowered = scene_of(draft.design)
    middle = np.array([draft.plan.centre_mm])
    runs = [trace_scene(lowered, middle, [None], seed=seed).flux.sum() for seed in range(1, seeds + 1)]
    emitter, receiver = draft.cavity.emitters[0], draft.cavity.receivers[0]
    block = Block(
        size=(draft.cavity.length_mm, draft.cavity.width_mm, thickness),
        index=lowered.refractive_index,
        absorption=lowered.absorption_per_mm,
        cover="bare" if cover is None else "wet",
        floor=board,
        wall=wall,
        white=cover or 0.0,
        emitter=emitter.position_mm[:2],
        receiver=receiver.position_mm[:2],
        emitter_width=emitter.part.active_width_mm.value,
        receiver_width=receiver.part.active_width_mm.value,
    )
    nodes = response_nodes(receiver.part, lowered.refractive_index)
    share, error, _ = received(
        block,
        Pattern.of_half_angle(emitter.part.half_angle_deg.value),
        lambda cosine: np.interp(cosine, cosine_nodes(), nodes),
        rays,
        1,
    )
    return (float(np.mean(runs)), float(np.std(runs, ddof=1) / np.sqrt(seeds))), (share, error)


def engine_table() -> str:
    """Received share by the engine and by the walk."""
    rows = []
    for scene in ENGINE:
        (engine, own), (walk, error) = both(scene, 400_000)
        rows.append(
            [
                *(("bare" if one is None else f"{one:g}") for one in scene),
                *(f"{1e3 * v:.4f} ± {1e3 * e:.4f}" for v, e in ((engine, own), (walk, error))),
                f"{100.0 * (engine / walk - 1.0):+.2f}",
                f"{(engine - walk) / np.hypot(own, error):+.1f}",
            ]
        )
    return markdown_table(
        [
            "thickness mm",
            "board",
            "sides",
            "cover",
            "engine (16 seeds), per mille of the emitted light",
            "walk",
            "difference %",
            "joint standard errors",
        ],
        rows,
    )


TABLES = {
    "counts": counts_table,
    "measured ratios": measured_table,
    "predicted ratios": predicted_table,
    "inputs": inputs_table,
    "scenes": scenes_table,
    "orders": orders_table,
    "outlines": outlines_table,
    "engine": engine_table,
}

if __name__ == "__main__":
    write_tables(PAGE, MADE_BY, TABLES, sys.argv[1:])

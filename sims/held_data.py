"""Data sets of presses by objects of any form: a list of presses (CSV) becomes frames that learners take.

The list
--------
A heading, then one press by one object in each row:

    x_mm, y_mm             place of the object's centre in the cavity [mm]
    depth_mm or force_n    how far it moves from first touch [mm], or the force that presses it [N]
    shear_x_mm, shear_y_mm how far it then moves sideways, 0 if left out [mm]
    x2_mm, y2_mm, depth2_mm place and depth of a second touch by the same ball, which moves with the first [mm]. Rows
                           that leave all three empty have one touch
    object                 kind, with keys if need be: cylinder, or cylinder;radius=5. Semicolons stand for the commas
                           of `--object`, which would end a cell. An empty cell means the object given for all
    radius, yaw, ...       any key of the objects; lengths may end in _mm and angles in _deg. An empty cell keeps the
                           object's own value
    role                   train (also if empty) or test

The data
--------
Each press has `APPROACH_MM` frames above the pad, then `TOUCHED` frames at its depth. All presses are taken twice, in
ambient light and in the dark, so that learners see how gains drift between sets. Noise, drift and errors of the stage
are those of `optopad.sims.readings.signal_chain`. The label is the place where the object is after a motion sideways.
Light is traced at the listed press. So the errors of the stage are subtracted from the reported place and depth, and
the spread is the same. An object is lifted when the time of its press is over. With `noise.release_residue`, the next
press of the set still has its remainder.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.csv_table import CsvTable, is_number, read_csv
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError, shown
from optopad.design.fields.base import nearest
from optopad.design.held_object import KINDS, MM_PER, UNITS, HeldObject, Sphere, held_of, held_with
from optopad.design.press_protocol import MOST_PLACES
from optopad.design.progress import OnStep
from optopad.design.recordings import ROLES, SetEntry
from optopad.design.spec import SensorDesign
from optopad.sims.held import AskedPress, Place, all_pressed, held_light, pressed, require_asked
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.readings.data_writer import ByPress, DataWriter
from optopad.sims.readings.dataset import clipped_note, read_data
from optopad.sims.readings.press_data import PressData
from optopad.sims.readings.protocol import FRAME, PRESS, SET, header_for, untouched_readout
from optopad.sims.readings.signal_chain import (
    Remainder,
    SignalChain,
    chain_of,
    drawn_press,
    drawn_set_offset_mm,
)
from optopad.sims.verdict.presses import untouched_flux

APPROACH_MM = (-1.0, -0.8, -0.6, -0.4)
"""Depths of the frames before a press [mm]: none touches, whatever the error of the reference depth."""
TOUCHED = 4
"""Frames of the touched pad in each press: as many as untouched ones, so that no class outweighs the other."""
PRESS_S = 5.0
"""Time from one press to the next [s], for the drift within a set; as on a stage."""
WINDOW = 16
"""Presses whose deformed tops are held in memory at a time; a top has 0.3 to 1 MB."""
NEEDED = (
    "the columns x_mm, y_mm, and depth_mm or force_n; x2_mm, y2_mm, depth2_mm, shear_x_mm, shear_y_mm, object, its "
    "keys, role are optional"
)
GIVEN_BY_LIST = ("x", "y", "depth")
"""Keys of an object that a list has columns for."""
MOST_NOTES = 3


def _key_columns() -> dict[str, str]:
    """Key of an object by the name of its column."""
    found: dict[str, str] = {}
    for kind in KINDS.values():
        for key, field in kind.model_fields.items():
            if key != "kind" and key not in GIVEN_BY_LIST:
                is_number = float in (field.annotation, *get_args(field.annotation))
                unit = next(iter(UNITS.get(key, MM_PER)))
                found |= {key: key} | ({f"{key}_{unit}": key} if is_number and unit else {})
    return found


KEY_COLUMNS = _key_columns()
SHEAR_COLUMNS = ("shear_x_mm", "shear_y_mm")
SECOND_COLUMNS = ("x2_mm", "y2_mm", "depth2_mm")
PRESS_COLUMNS = ("x_mm", "y_mm", "depth_mm", "force_n", *SECOND_COLUMNS, *SHEAR_COLUMNS, "object", "role")


@dataclass(frozen=True, kw_only=True)
class ListedPress:
    """A row of a list of presses.

    Attributes
    ----------
    where : file and row, as the start of a message
    asked : the press, by one object or by two equal balls
    role : train or test
    """

    where: str
    asked: AskedPress
    role: str

    @property
    def shear_mm(self) -> Place:
        """How far the object moves sideways."""
        return (0.0, 0.0) if self.asked.shear_mm is None else self.asked.shear_mm

    @property
    def place_mm(self) -> Place:
        """Where the object is after that."""
        return self.asked.at_mm[0] + self.shear_mm[0], self.asked.at_mm[1] + self.shear_mm[1]

    def touches_mm(self, depth_mm: float) -> FloatArray:
        """Place after that and depth of each touch (touch, 3) [mm]; `depth_mm` is the solved depth of a single one."""
        if len(self.asked.held) == 1:
            return np.array([[*self.place_mm, depth_mm]])
        given = np.array([[one.x, one.y, one.depth] for one in self.asked.held], dtype=np.float64)
        return np.asarray(given + np.array([*self.shear_mm, 0.0]))


def read_presses(file: Path, default: HeldObject | None = None) -> tuple[ListedPress, ...]:
    """Read a list of presses.

    Parameters
    ----------
    default : object of the rows that name none

    Raises
    ------
    InputError : a column is missing or unknown, or a value is invalid; the message names file, row and column.
    """
    table = read_csv(file, needed=NEEDED, lower=True)
    keys = _require_columns(table)
    if len(table.rows) > MOST_PLACES:
        raise InputError(f"{file}: has {len(table.rows)} presses; at most {MOST_PLACES}: split the list")
    is_force = "force_n" in table.heading
    amount = _amounts(table, "force_n" if is_force else "depth_mm")
    places = list(zip(table.numbers("x_mm"), table.numbers("y_mm"), strict=True))
    none = [0.0] * len(table.rows)
    along = [table.numbers(name) if name in table.heading else none for name in SHEAR_COLUMNS]
    shears = list(zip(*along, strict=True))
    known: dict[str, HeldObject] = {}
    found = []
    for row, record in enumerate(table.records()):
        where, role = table.where(row), record.get("role") or ROLES[0]
        if role not in ROLES:
            raise InputError(f"{where}: role is {shown(role)}, needs {' or '.join(ROLES)}")
        held = _held(record.get("object", ""), default, known, where, file.parent)
        given = {key: record[column] for column, key in keys.items() if record[column]}
        held = held_with(held, given, where, file.parent) if given else held
        for key in GIVEN_BY_LIST:
            if getattr(held, key) is not None:
                raise InputError(
                    f"{where}: {key}={getattr(held, key):g} of the object is refused: the list has columns for it; "
                    f"drop {key} from the object"
                )
        asked = AskedPress(
            held=(held,),
            at_mm=places[row],
            depth_mm=None if is_force else amount[row],
            force_n=amount[row] if is_force else None,
            shear_mm=shears[row] if any(shears[row]) else None,
        )
        cells = {name: record[name] for name in SECOND_COLUMNS if record.get(name)}
        found.append(
            ListedPress(where=where, asked=_of_two(asked, cells, where) if cells else asked, role=role)
        )
    return tuple(found)


def _of_two(asked: AskedPress, cells: dict[str, str], where: str) -> AskedPress:
    """The press with a second touch, from the cells of its columns."""
    (held,), (x, y) = asked.held, asked.at_mm
    missing = [name for name in SECOND_COLUMNS if name not in cells]
    if missing:
        raise InputError(
            f"{where}: has {', '.join(cells)} without {', '.join(missing)}; a second touch has x2_mm, y2_mm and "
            "depth2_mm, a single one none of them"
        )
    if asked.depth_mm is None:
        raise InputError(
            f"{where}: depth2_mm does not go with force_n, which does not say how deep each touch is; give depth_mm"
        )
    if not isinstance(held, Sphere):
        raise InputError(
            f"{where}: x2_mm is a second touch by {held.words}; two touches are those of a ball: object = sphere, or "
            "drop x2_mm, y2_mm and depth2_mm"
        )
    x2, y2, depth2 = (_number(cells[name], name, where) for name in SECOND_COLUMNS)
    _require_depth(depth2, "depth2_mm", where)
    apart = float(np.linalg.norm([x2 - x, y2 - y, depth2 - asked.depth_mm]))
    if apart < 2.0 * held.radius:
        raise InputError(
            f"{where}: x2_mm, y2_mm: the balls at ({x:g}, {y:g}) and ({x2:g}, {y2:g}) mm overlap: their centres "
            f"are {apart:.2f} mm apart, need two radii, {2.0 * held.radius:g} mm; move them apart, or take a smaller "
            "ball"
        )
    both = ({"x": x, "y": y, "depth": asked.depth_mm}, {"x": x2, "y": y2, "depth": depth2})
    return replace(asked, held=tuple(held.model_copy(update=one) for one in both), depth_mm=None)


def _number(text: str, name: str, where: str) -> float:
    value = float(text) if is_number(text) else math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {name} is {shown(text)}, needs a finite number; correct or drop the row")
    return value


def _require_columns(table: CsvTable) -> dict[str, str]:
    """Check the columns' names; the keys of objects among them, by column."""
    known = (*PRESS_COLUMNS, *KEY_COLUMNS)
    for name in table.heading:
        if re.fullmatch(r"(x|y|depth)[3-9]_mm", name):
            raise InputError(
                f"{table.file}: has {name}; a row has one touch or two, x2_mm, y2_mm and depth2_mm: leave others out"
            )
        if name not in known:
            near = nearest(name, known)
            hint = f"did you mean {near[0]}?" if near else f"a list has {NEEDED}"
            raise InputError(f"{table.file}: the column {shown(name)} is not known; {hint}")
    lacking = [name for name in PRESS_COLUMNS[:2] if name not in table.heading]
    amounts = [name for name in PRESS_COLUMNS[2:4] if name in table.heading]
    if lacking or len(amounts) != 1:
        said = (
            f"no {' and no '.join(lacking)}" if lacking else " and ".join(amounts) or "no depth_mm or force_n"
        )
        raise InputError(f"{table.file}: has {said}; needs {NEEDED}")
    keys = {name: KEY_COLUMNS[name] for name in table.heading if name in KEY_COLUMNS}
    for name, key in keys.items():
        if name != key and key in keys:
            raise InputError(f"{table.file}: has the columns {key} and {name}; keep one")
    return keys


def _amounts(table: CsvTable, name: str) -> list[float]:
    """Depths [mm] or forces [N]."""
    found = table.numbers(name)
    for row, value in enumerate(found):
        _require_depth(value, name, table.where(row))
    return found


def _require_depth(value: float, name: str, where: str) -> None:
    if value < 0.0 or (value == 0.0 and name == "force_n"):
        limit = "above 0" if name == "force_n" else "0 or more: it is measured from first touch down"
        raise InputError(f"{where}: {name} is {value:g}, must be {limit}; correct the row")


def _held(
    cell: str, default: HeldObject | None, known: dict[str, HeldObject], where: str, folder: Path
) -> HeldObject:
    if cell not in known:
        if cell:
            try:
                known[cell] = held_of(cell.replace(";", ","), folder)
            except InputError as err:
                raise InputError(f"{where}: {err}") from None
        elif default is None:
            raise InputError(
                f"{where}: names no object; write its kind into the column object, as cylinder, or name one for all "
                "rows with --object"
            )
        else:
            known[cell] = default
    return known[cell]


def held_data(
    design: SensorDesign,
    presses: Sequence[ListedPress],
    file: Path,
    *,
    seed: int = 0,
    asked: Any = None,
    journal_folder: Path | None = None,
    on_step: OnStep,
) -> dict[str, Any]:
    """Compute listed presses and write them as a data set (`optopad.sims.readings.dataset`); returns a summary.

    All contacts are solved before any light is traced, so that a press outside the model is refused early. Finished
    presses of an interrupted run of the same work are reused.

    Parameters
    ----------
    file : netCDF file to write
    seed : random seed of drift, noise and errors of the stage; light does not depend on it
    asked, journal_folder : as for `DataWriter`

    Raises
    ------
    InputError, ModelScopeError : a press is invalid or outside the models; the message names its row.
    """
    draft = Draft.of(design)
    if design.noise.wall_unbonded_share > 0.0:
        raise ModelScopeError(
            "noise.wall_unbonded_share: presses by objects are computed with bonded walls; set it to 0"
        )
    solved = _solved(draft, presses, on_step)
    readout = untouched_readout(design, untouched_flux(draft, seed=0))
    chain = chain_of(design, readout)
    sets = _sets(presses)
    header = header_for(
        design,
        chain,
        sets,
        {
            "points_per_press": len(APPROACH_MM) + TOUCHED,
            "touched_per_press": TOUCHED,
            "counts_per_flux": list(readout.of_each(chain.gains.shape[1])),
            "seed": seed,
        },
    )
    touches = max(len(one.asked.held) for one in presses)
    header = replace(header, others_mm=np.zeros((0, touches - 1, 3)))
    texts = [_text(one.asked.held[0]) for one in presses]
    rows = [
        [
            text,
            *one.asked.at_mm,
            *one.shear_mm,
            *amounts,
            *(ball.line for ball in one.asked.held if ball.depth is not None),
        ]
        for text, one, amounts in zip(texts, presses, solved, strict=True)
    ]
    is_sideways = any(any(one.shear_mm) for one in presses)
    shears = {name: [one.shear_mm[k] for one in presses] for k, name in enumerate(SHEAR_COLUMNS)}
    by_press: ByPress = {
        "object": texts,
        "force_n": [force for _, force in solved],
        **(shears if is_sideways else {}),
    }
    with DataWriter(
        file, header, asked=[asked, rows], journal_folder=journal_folder, by_press=by_press
    ) as writer:
        taken_up = len(writer.done)
        for press in _drawn(draft, presses, chain, header, seed, writer.done, on_step):
            writer.add(press)
        writer.finish()
    data = read_data(file, design)
    notes = [f"{one.where}: {note}" for one in presses for note in one.asked.held[0].notes]
    more = [f"and {len(notes) - MOST_NOTES} more such rows"] if len(notes) > MOST_NOTES else []
    return {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "file": str(file),
        "presses": len(presses),
        **({"two_touches": sum(len(one.asked.held) > 1 for one in presses)} if touches > 1 else {}),
        "objects": list(dict.fromkeys(one.asked.held[0].words for one in presses)),
        "depth_mm": [depth for depth, _ in solved],
        "force_n": [force for _, force in solved],
        "sets": [
            asdict(one) | {"presses": sum(press.role == one.role for press in presses)} for one in data.sets
        ],
        "samples": len(data),
        "taken_up_presses": taken_up,
        "clipped": clipped_note(data),
        "notes": notes[:MOST_NOTES] + more,
    }


def _solved(draft: Draft, presses: Sequence[ListedPress], on_step: OnStep) -> list[tuple[float, float]]:
    """Depth [mm] and force [N] of each press; an error names the row."""
    found = [(0.0, 0.0)] * len(presses)
    done = 0

    def solve(number: int) -> None:
        nonlocal done
        one = presses[number]
        try:
            press = pressed(draft, one.asked)
        except (InputError, ModelScopeError) as err:
            raise type(err)(f"{one.where}: {err}") from None
        found[number] = press.depth_mm, press.force_n
        done += 1
        on_step("objects", done / len(presses))

    for one in presses:
        try:
            require_asked(draft, one.asked)
        except (InputError, ModelScopeError) as err:
            raise type(err)(f"{one.where}: {err}") from None
    run_each(solve, len(presses))
    return found


def _sets(presses: Sequence[ListedPress]) -> tuple[SetEntry, ...]:
    roles = [role for role in ROLES if any(one.role == role for one in presses)]
    return tuple(
        SetEntry(name=f"{role}-{light}", role=role, pattern="unknown", is_ambient=light == "ambient")
        for role in roles
        for light in ("ambient", "dark")
    )


def _drawn(
    draft: Draft,
    presses: Sequence[ListedPress],
    chain: SignalChain,
    header: PressData,
    seed: int,
    but: frozenset[tuple[int, int]],
    on_step: OnStep,
) -> Iterator[PressData]:
    """Samples of each press in each set of its role, but for those (set, press) in `but`."""
    of_sets = [_DrawnList(chain, header, number, seed) for number in range(len(header.sets))]
    has_memory = chain.noise.release_residue > 0.0
    last: dict[str, Remainder] = {}
    wanted: list[tuple[int, list[int]]] = []
    for k, press in reversed(list(enumerate(presses))):
        sets = [s for s, one in enumerate(header.sets) if one.role == press.role and (s, k) not in but]
        follower = next((drawn for j, drawn in reversed(wanted) if presses[j].role == press.role), [])
        if sets or (has_memory and follower):
            wanted.append((k, sets))
    wanted.reverse()
    for start in range(0, len(wanted), WINDOW):
        window = wanted[start : start + WINDOW]
        asked = [presses[k].asked for k, _ in window]
        untouched, flux, depths = _light(draft, asked)
        for (k, sets), touched, depth in zip(window, flux, depths, strict=True):
            role = presses[k].role
            for s in sets:
                yield of_sets[s].press(k, presses[k].touches_mm(depth), untouched, touched, last.get(role))
            if has_memory:
                last[role] = Remainder(change=touched - untouched, released_s=PRESS_S * (k + 1))
        on_step("light", (start + len(window)) / len(wanted))


def _light(draft: Draft, asked: Sequence[AskedPress]) -> tuple[FloatArray, FloatArray, list[float]]:
    """Untouched flux (emitter, receiver), flux (press, emitter, receiver), and depths [mm]."""
    found = all_pressed(draft, asked)
    shades = [one.reflectance for one in asked]
    flux: dict[int, FloatArray] = {}
    for shade in dict.fromkeys(shades):
        rows = [k for k, one in enumerate(shades) if one == shade]
        light = held_light(draft, [found[k] for k in rows], reflectance=shade)
        flux |= dict(zip(rows, light.flux, strict=True))
    return light.untouched, np.stack([flux[k] for k in range(len(asked))]), [one.depth_mm for one in found]


class _DrawnList:
    """Draws the presses of one set, which share drift, ambient light and the error of the depth's zero."""

    def __init__(self, chain: SignalChain, header: PressData, number: int, seed: int) -> None:
        self.chain, self.header, self.number, self.seed = chain, header, number, seed
        rng = self._rng(SET)
        self.offset_mm = drawn_set_offset_mm(chain.noise, rng)
        self.drawn = chain.draw_set(rng, is_ambient=header.sets[number].is_ambient)

    def press(
        self,
        k: int,
        touches_mm: FloatArray,
        untouched: FloatArray,
        touched: FloatArray,
        last: Remainder | None,
    ) -> PressData:
        """Samples of the k-th press of the list, from the flux (emitter, receiver) without and with contact.

        `touches_mm` has x, y, depth of each touch; all are lifted together. `last` is what the press before it in the
        set has left; None if nothing.
        """
        errors = drawn_press(self.chain.noise, self.offset_mm, self._rng(PRESS, k))
        frames = len(APPROACH_MM) + TOUCHED
        true = np.repeat(touches_mm[:, np.newaxis], frames, axis=1)
        true[:, : len(APPROACH_MM), 2] = APPROACH_MM
        reported = true - [*errors.place_error_mm, errors.zero_offset_mm]
        others = np.full((frames, self.header.others_mm.shape[1], 3), np.nan)
        others[:, : len(true) - 1] = np.swapaxes(reported[1:], 0, 1)
        time_s = PRESS_S * (k + np.arange(1, frames + 1) / (frames + 1))
        flux = np.stack([untouched] * len(APPROACH_MM) + [touched] * TOUCHED)
        if last is not None:
            flux = last.added(flux, time_s, self.chain.noise)
        return replace(
            self.header,
            counts=self.chain.counts(flux, time_s, self._rng(FRAME, k), drawn=self.drawn),
            press_mm=reported[0],
            others_mm=others,
            time_s=time_s,
            set_number=np.full(frames, self.number, dtype=np.int64),
            place_number=np.full(frames, k, dtype=np.int64),
            true_press_mm=true[0],
        )

    def _rng(self, purpose: int, k: int = 0) -> np.random.Generator:
        return np.random.default_rng([self.seed, self.number, purpose, k])


def _text(held: HeldObject) -> str:
    """An object as `--object` takes it, with all of its keys."""
    values = held.model_dump(exclude_none=True, exclude={"kind", *GIVEN_BY_LIST})
    said = [
        f"{key}={value:.9g}" if isinstance(value, float) else f"{key}={value}"
        for key, value in values.items()
    ]
    return ",".join([held.kind, *said])

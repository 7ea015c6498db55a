"""Circuit boards: the right nets, enough clearance, parts at their places, and files that agree with each other."""

from __future__ import annotations

import csv
import io
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from optopad.bundle_parts import write_fabrication
from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError
from optopad.design.mold.outline import outline_of
from optopad.design.preset import PRESETS, preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.board import (
    Board,
    board_gaps,
    board_of,
    unrouted_words,
    write_board,
    write_gaps,
)
from optopad.fabrication.board.files import BILL_COLUMNS, PLACEMENT_COLUMNS, board_texts
from optopad.fabrication.board.model import CLEARANCE_MM, EDGE_MM, BoardHole, Unrouted
from optopad.fabrication.board.packages import board_data
from optopad.fabrication.board.placement import placed
from optopad.fabrication.board.router import routed
from optopad.fabrication.connections import connections_of
from optopad.screen.answer import board_words
from tests.fabrication.board.copper import closest, pieces, pour_gap
from tests.said import says

INVERTING = {"1": "2", "7": "6", "8": "9", "14": "13"}
"""Inverting input next to each output of four amplifiers in SOIC-14."""


def changed(of: str, /, **tables: Any) -> SensorDesign:
    document = preset(of).model_dump(mode="json", exclude_unset=True)
    for table, values in tables.items():
        document[table] = {**document[table], **values} if isinstance(values, dict) else values
    return SensorDesign.model_validate(document)


CHIPS = {"emitters": {"shift_register": "74hc595"}, "receivers": {"multiplexer": "74hc4067"}}
SINKS = {"emitters": {"driver": "tlc5947"}, "receivers": {"converter": "ads8688"}}


def floor(layout: dict[str, Any], emitter: str, receiver: str) -> SensorDesign:
    return changed(
        "piacenza2017-pad",
        name="floor",
        cavity={"black_thickness_mm": 0.0},
        emitters={"part": emitter, "height_mm": None},
        receivers={"part": receiver, "height_mm": None},
        layout=[layout],
        board={"kind": "teensy-41", **CHIPS},
    )


@cache
def design_of(name: str) -> SensorDesign:
    if name == "checkerboard":
        layout = {"pattern": "checkerboard", "columns": 4, "rows": 4, "pitch_mm": 6.0, "first": "emitter"}
        return floor(layout, "kingbright-apt2012zgc", "vishay-vemd4110x01")
    if name == "couplers":
        layout = {
            "pattern": "grid",
            "kind": "coupler",
            "columns": 3,
            "rows": 3,
            "pitch_mm": 6.0,
            "apart_mm": 0.7,
        }
        return floor(layout, "njr-njl5908ar-emitter", "njr-njl5908ar-receiver")
    if name == "sinks":
        return changed("piacenza2017-pad", board={"kind": "teensy-41", **SINKS})
    return preset(name)


@cache
def board(name: str) -> Board:
    return board_of(design_of(name))


QUICK = ("gripper-teensy", "couplers")
LATER = ("piacenza2017-pad", "sinks", "checkerboard")
every_board = pytest.mark.parametrize("name", [*QUICK, *LATER])
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in LATER]
by_shape = pytest.mark.parametrize("name", [*QUICK, *SLOW])


def at(one: Board, reference: str, number: str) -> str:
    """Net of a pad."""
    part = next(part for part in one.footprints if part.reference == reference)
    return next(pad.net for pad in part.pads if pad.number == number)


def on(one: Board, net: str) -> dict[str, str]:
    """Pads on a net: the pad's number by the part's reference, the last one of each part."""
    return dict(name.rsplit("-", 1) for name in one.nets[net])


def reaches(one: Board, circuit: Circuit, net: str, pin: str) -> None:
    """A net is the terminal of the wiring table: a pin of the header, or the pin of its name at the chip."""
    assert net == pin
    pads = on(one, net)
    if "-" not in pin:
        assert "J1" in pads
        return
    chip, terminal = pin.split("-")
    chips = next(chips for chips in circuit.chips if chip in chips.names)
    number = int(re.sub(r"\D", "", terminal))
    row = next(pin for pin, to in (*chips.entry.family.left, *chips.entry.family.right) if to == "{part}")
    assert board_data()["chips"][chips.chip_id]["pins"][int(pads[chip]) - 1] == row.format(number)


def lead(one: Board, kind: str, number: int, name: str) -> str:
    """Net of a lead of an emitter or receiver."""
    if any(part.reference.startswith("OC") for part in one.footprints):
        return at(one, f"OC{number}", kind + name)
    return at(one, f"{kind}{number}", name)


@every_board
def test_nets_are_those_of_the_wiring_table(name: str) -> None:
    circuit, one = Circuit.of(design_of(name)), board(name)
    supply = f"+{circuit.board.emitter_v:g}V"
    for number, connection in enumerate(connections_of(circuit).emitters, start=1):
        anode, cathode = (lead(one, "E", number, end) for end in "AK")
        if circuit.led_driver is not None:
            assert anode == supply
            reaches(one, circuit, cathode, connection.pin)
            continue
        assert {at(one, f"RS{number}", end) for end in "12"} == {anode, supply}
        base, emitter, collector = (at(one, f"Q{number}", end) for end in "123")
        assert (emitter, collector) == ("GND", cathode)
        assert at(one, f"RB{number}", "1") == base
        reaches(one, circuit, at(one, f"RB{number}", "2"), connection.pin)
    for number, connection in enumerate(connections_of(circuit).receivers, start=1):
        anode, cathode = (lead(one, "R", number, end) for end in "AK")
        assert anode == "GND"
        amplifier, inverting = next((part, pad) for part, pad in on(one, cathode).items() if part[0] == "A")
        output = next(out for out, its in INVERTING.items() if its == inverting)
        out = at(one, amplifier, output)
        for mark in ("RF", "CF"):
            assert {at(one, f"{mark}{number}", end) for end in "12"} == {cathode, out}
        assert {at(one, amplifier, pad) for pad in ("3", "5", "10", "12", "11")} == {"GND"}
        reaches(one, circuit, out, connection.pin)


def test_chips_share_their_lines_and_chain() -> None:
    one = board("checkerboard")
    pins = board_data()["chips"]["74hc595"]["pins"]
    net = {chip: {pin: at(one, chip, str(k)) for k, pin in enumerate(pins, start=1)} for chip in ("S1",)}
    assert net["S1"]["MR"] == net["S1"]["VCC"] == "+3.3V"
    assert net["S1"]["OE"] == net["S1"]["GND"] == "GND"
    assert {"J1", "S1"} <= set(on(one, net["S1"]["SHCP"]))
    muxes = board_data()["chips"]["74hc4067"]["pins"]
    select = {at(one, "M1", str(muxes.index(f"S{k}") + 1)) for k in range(4)}
    assert len(select) == 4
    assert all("J1" in on(one, line) for line in select)


@by_shape
def test_copper_of_two_nets_keeps_its_clearance(name: str) -> None:
    one = board(name)
    assert not one.unrouted
    for layer in (0, 1):
        least, names = closest(one, layer)
        assert least >= CLEARANCE_MM - 1e-6, names
        assert pour_gap(one, layer) >= CLEARANCE_MM - 1e-6
        _, segments, halves = pieces(one, layer)
        x0, y0, x1, y1 = one.box
        x, y = segments[:, ::2], segments[:, 1::2]
        edge = np.min([x - x0, x1 - x, y - y0, y1 - y], axis=(0, 2)) - halves
        assert np.min(edge) >= EDGE_MM - 1e-6


@by_shape
def test_every_net_is_one_piece(name: str) -> None:
    """Copper that touches is joined, from the shapes alone: then each net has one piece."""
    one = board(name)
    joined: dict[object, object] = {}

    def root(key: object) -> object:
        while joined.setdefault(key, key) != key:
            key = joined[key]
        return key

    spots = [
        (track.net, layer, end)
        for track in one.tracks
        for layer in (track.layer,)
        for end in (track.start, track.end)
    ]
    for track in one.tracks:
        joined[root((track.net, track.layer, track.start))] = root((track.net, track.layer, track.end))
    for via in one.vias:
        joined[root((via.net, 0, (via.x, via.y)))] = root((via.net, 1, (via.x, via.y)))
    for part, pad in one.pads:
        key = part.reference, pad.number, pad.x, pad.y
        for net, layer, (x, y) in spots:
            reach = max(pad.width, pad.height) / 2
            if net == pad.net and layer in pad.layers and abs(x - pad.x) < reach and abs(y - pad.y) < reach:
                turn = np.deg2rad(-pad.angle_deg)
                along = np.cos(turn) * (x - pad.x) - np.sin(turn) * (y - pad.y)
                across = np.sin(turn) * (x - pad.x) + np.cos(turn) * (y - pad.y)
                inside = abs(along) < pad.width / 2 and abs(across) < pad.height / 2
                if np.hypot(along, across) < pad.width / 2 if pad.is_round else inside:
                    joined[root(key)] = root((net, layer, (x, y)))
    for net, pads in one.nets.items():
        its = {root((part.reference, pad.number, pad.x, pad.y)) for part, pad in one.pads if pad.net == net}
        assert len(its) == 1, (net, pads)


def test_leads_go_through_the_holes_of_the_mold() -> None:
    one, mold = board("piacenza2017-pad"), outline_of(design_of("piacenza2017-pad"))
    found = 0
    for k, socket in enumerate((s for s in mold.sockets if s.part.kind == "receiver"), start=1):
        part = next(part for part in one.footprints if part.reference == f"R{k}")
        places = np.array(sorted((round(pad.x, 4), round(pad.y, 4)) for pad in part.pads))
        assert places == pytest.approx(np.array(sorted((hole.x, hole.y) for hole in socket.holes)), abs=0.01)
        found += 1
    assert found == 8
    inside = {(hole.x, hole.y) for hole in one.holes}
    assert inside >= {(hole.x, hole.y) for hole in mold.fixing_holes}


@pytest.mark.parametrize(("wall", "cathode"), [("south", 1), ("north", -1)])
def test_cathode_of_a_side_looking_part_is_left_of_its_light(wall: str, cathode: int) -> None:
    """Seen from the cavity, left on the south wall is towards high x, and on the north wall towards low x."""
    cavity, one = Circuit.of(design_of("piacenza2017-pad")).cavity, board("piacenza2017-pad")
    number = next(k for k, part in enumerate(cavity.receivers, start=1) if part.wall == wall)
    part = next(part for part in one.footprints if part.reference == f"R{number}")
    x = {pad.number: pad.x for pad in part.pads}
    assert (x["K"] - x["A"]) * cathode == pytest.approx(2.54)


def test_floor_parts_are_at_their_design_positions() -> None:
    cavity, one = Circuit.of(design_of("checkerboard")).cavity, board("checkerboard")
    for kind, parts in (("E", cavity.emitters), ("R", cavity.receivers)):
        for k, part in enumerate(parts, start=1):
            its = next(found for found in one.footprints if found.reference == f"{kind}{k}")
            middle = np.mean([(pad.x, pad.y) for pad in its.pads], axis=0)
            assert middle == pytest.approx(part.position_mm[:2], abs=0.01)
            apart = np.hypot(its.pads[1].x - its.pads[0].x, its.pads[1].y - its.pads[0].y)
            assert apart == pytest.approx(part.part.lead_pitch_mm.value)


def test_a_coupler_is_one_part_with_both_pairs_of_pads() -> None:
    cavity, one = Circuit.of(design_of("couplers")).cavity, board("couplers")
    emitter, receiver = cavity.emitters[4], cavity.receivers[4]
    part = next(found for found in one.footprints if found.reference == "OC5")
    assert [pad.number for pad in part.pads] == ["EK", "EA", "RK", "RA"]
    assert part.body == pytest.approx((1.06, 1.46), abs=0.01)
    along = np.subtract(receiver.position_mm[:2], emitter.position_mm[:2])
    pads = {pad.number: np.array((pad.x, pad.y)) for pad in part.pads}
    # 0.885 mm between the two pairs, 0.83 mm within a pair: the drawing of the REMODEL board.
    assert pads["RA"] - pads["EA"] == pytest.approx(along / np.hypot(*along) * 0.885, abs=0.01)
    assert np.hypot(*(pads["EK"] - pads["EA"])) == pytest.approx(0.83)


@pytest.mark.parametrize(
    ("emitter", "receiver", "looks", "leads", "behind"),
    [
        ("kingbright-apt2012zgc", "osram-sfh206k", "in", ("two wires", "leads"), (2.75, 1.55)),
        ("kingbright-apt2012zgc", "osram-sfh206k", "up", ("kingbright-apt2012zgc", "leads"), (0.0, -4.95)),
    ],
)
def test_parts_on_the_floor_are_held_as_they_look(
    emitter: str, receiver: str, looks: str, leads: tuple[str, str], behind: tuple[float, float]
) -> None:
    """Wires 2 mm behind a body of 0.75 mm; leads 1.55 mm behind the face, or 1.5 mm beyond a base 3.45 mm away."""
    layout = {"pattern": "ring_inside", "emitters": 4, "receivers": 4, "inset_mm": 9.0, "looks": looks}
    design = floor(layout, emitter, receiver)
    one, cavity = placed(design), Circuit.of(design).cavity
    for kind, parts, package, out in zip(
        "ER", (cavity.emitters, cavity.receivers), leads, behind, strict=True
    ):
        for k, part in enumerate(parts, start=1):
            its = next(found for found in one.footprints if found.reference == f"{kind}{k}")
            assert its.package == package
            middle = np.mean([(pad.x, pad.y) for pad in its.pads], axis=0)
            assert middle == pytest.approx(np.array(part.line.point(0.0, out)), abs=0.01)


def test_a_board_that_cannot_be_routed_names_its_connections(tmp_path: Path) -> None:
    whole = placed(design_of("piacenza2017-pad"))
    _, y0, _, y1 = whole.box
    wall = [BoardHole(x=50.0, y=float(y), diameter_mm=3.0) for y in np.arange(y0 + 1.5, y1, 2.5)]
    one = routed(replace(whole, holes=(*whole.holes, *wall)))
    assert {"E1-K", "R1-K"} <= {lost.net for lost in one.unrouted}
    assert closest(one, 0)[0] >= CLEARANCE_MM - 1e-6
    assert not any((track.start[0] - 50.0) * (track.end[0] - 50.0) < 0 for track in one.tracks)
    assert says(unrouted_words(one), "E1-K")
    write_board(one, tmp_path)
    assert "WARNING" in (tmp_path / "notes.txt").read_text()


def test_routing_is_deterministic() -> None:
    assert board_of(design_of("gripper-teensy")) == board("gripper-teensy")


def parsed(text: str) -> list[Any]:
    """The nested lists of an S-expression."""
    stack: list[list[Any]] = [[]]
    for mark, quoted, word in re.findall(r'([()])|"((?:[^"\\]|\\.)*)"|([^\s()"]+)', text):
        if mark == "(":
            stack.append([])
        elif mark == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(quoted or word)
    assert len(stack) == 1
    return stack[0][0]


def named(tree: list[Any], name: str) -> list[Any]:
    return [one for one in tree if isinstance(one, list) and one and one[0] == name]


@every_board
def test_schematic_and_board_file_have_the_same_nets(name: str) -> None:
    one, texts = board(name), board_texts(board(name))
    sheet = parsed(texts["optopad.kicad_sch"])
    pins = {
        symbol[1]: {
            named(pin, "number")[0][1]: tuple(map(float, named(pin, "at")[0][1:3]))
            for unit in named(symbol, "symbol")
            for pin in named(unit, "pin")
        }
        for symbol in named(named(sheet, "lib_symbols")[0], "symbol")
    }
    labels = {
        tuple(map(float, named(label, "at")[0][1:3])): label[1] for label in named(sheet, "global_label")
    }
    drawn: dict[str, set[str]] = {}
    for symbol in named(sheet, "symbol"):
        x, y = map(float, named(symbol, "at")[0][1:3])
        reference = next(one[2] for one in named(symbol, "property") if one[1] == "Reference")
        for number, (dx, dy) in pins[named(symbol, "lib_id")[0][1]].items():
            place = next((at for at in labels if np.hypot(at[0] - x - dx, at[1] - y + dy) < 1e-3), None)
            if place is not None:
                drawn.setdefault(labels[place], set()).add(f"{reference}-{number}")
    assert drawn == {net: set(pads) for net, pads in one.nets.items()}
    layout: dict[str, set[str]] = {}
    for footprint in named(parsed(texts["optopad.kicad_pcb"]), "footprint"):
        reference = next(text[2] for text in named(footprint, "fp_text") if text[1] == "reference")
        for pad in named(footprint, "pad"):
            if named(pad, "net"):
                layout.setdefault(named(pad, "net")[0][2], set()).add(f"{reference}-{pad[1]}")
    assert layout == drawn


def test_gerber_and_drill_files_have_every_pad_and_hole() -> None:
    one, texts = board("couplers"), board_texts(board("couplers"))
    spots = re.findall(r"X(-?\d+)Y(-?\d+)D03", texts["gerbers/optopad-F_Cu.gtl"])
    expected = [(pad.x, pad.y) for _, pad in one.pads] + [(via.x, via.y) for via in one.vias]
    x0, y0, _, _ = one.box
    found = sorted((round(int(x) / 1e6 + x0, 4), round(int(y) / 1e6 + y0, 4)) for x, y in spots)
    assert found == sorted((round(x, 4), round(y, 4)) for x, y in expected)
    drilled = re.findall(r"^X", texts["gerbers/optopad-PTH.drl"], re.MULTILINE)
    assert len(drilled) == len(one.vias) + sum(pad.drill_mm > 0 for _, pad in one.pads)
    assert len(re.findall(r"^X", texts["gerbers/optopad-NPTH.drl"], re.MULTILINE)) == len(one.holes)
    paste = re.findall("D03", texts["gerbers/optopad-F_Paste.gtp"])
    assert len(paste) == sum(not pad.drill_mm for _, pad in one.pads)


def test_bill_and_placement_name_the_same_parts(tmp_path: Path) -> None:
    one = board("couplers")
    written = write_board(one, tmp_path)
    assert all(path.stat().st_size for path in written)
    bill = list(csv.DictReader(io.StringIO((tmp_path / "bill.csv").read_text())))
    places = list(csv.DictReader(io.StringIO((tmp_path / "placement.csv").read_text())))
    assert tuple(bill[0]) == BILL_COLUMNS
    assert tuple(places[0]) == PLACEMENT_COLUMNS
    listed = [name for line in bill for name in line["Designator"].split(",")]
    assert sorted(listed) == sorted(line["Designator"] for line in places)
    assert len(set(listed)) == len(listed)
    coupler = next(line for line in places if line["Designator"] == "OC5")
    assert float(coupler["Mid X"].removesuffix("mm")) + one.box[0] == pytest.approx(16.0, abs=0.2)
    with zipfile.ZipFile(tmp_path / "gerbers.zip") as archive:
        assert len(archive.namelist()) == 9


def test_a_bundle_has_the_board(tmp_path: Path) -> None:
    write_fabrication(design_of("gripper-teensy"), tmp_path, None, 1e4)
    folder = tmp_path / "fabrication" / "board"
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*.*")} >= set(
        board_texts(board("gripper-teensy"))
    )
    assert "WARNING" not in (folder / "notes.txt").read_text()


@every_board
def test_the_longer_printed_line_of_a_chip_is_at_its_first_pad(name: str) -> None:
    one = board(name)
    chips = [part for part in one.footprints if len(part.pads) > 8 and part.reference != "J1"]
    lines = [line for line in one.lines if len(line) == 2]
    assert len(lines) == 2 * len(chips)
    for k, part in enumerate(chips):
        longer, shorter = lines[2 * k], lines[2 * k + 1]
        assert np.hypot(*np.subtract(*longer)) > np.hypot(*np.subtract(*shorter))
        first, last = part.pads[0], part.pads[len(part.pads) // 2 - 1]
        assert np.hypot(longer[0][0] - first.x, longer[0][1] - first.y) < 2.0
        assert np.hypot(longer[0][0] - last.x, longer[0][1] - last.y) > 5.0


def test_wires_are_not_in_the_bill() -> None:
    texts = board_texts(board("gripper-teensy"))
    assert "E1" not in re.findall(r"\bE\d+\b", texts["bill.csv"])
    assert "RS1" in texts["bill.csv"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"receivers": {"multiplexer": "adg706"}}, "ADG706"),
        ({"receivers": {"converter": "ads7953"}}, "ADS7953"),
    ],
)
def test_a_chip_without_known_pins_is_refused(change: dict[str, Any], words: str) -> None:
    design = changed("piacenza2017-pad", board={"kind": "teensy-41", **change})
    assert says(board_gaps(Circuit.of(design))[0], words)
    with pytest.raises(DesignError, match=words):
        board_of(design)


SYSTEM_PYTHON = "/usr/bin/python3"
"""The interpreter that Debian's KiCad has its module for."""
RULES_CHECK = """
import sys, pcbnew
board = pcbnew.LoadBoard(sys.argv[1])
pcbnew.ZONE_FILLER(board).Fill(board.Zones())
pcbnew.WriteDRCReport(board, sys.argv[2], pcbnew.EDA_UNITS_MILLIMETRES, True)
"""


@pytest.mark.full
@pytest.mark.skipif(shutil.which("pcbnew") is None, reason="needs KiCad")
def test_kicad_finds_no_violation_of_the_rules(tmp_path: Path) -> None:
    """Clearances, edges, holes, open connections and prints of every preset, with the ground filled by KiCad."""
    for name in (*PRESETS, "sinks", "checkerboard", "couplers"):
        one = board(name)
        assert not one.unrouted, name
        write_board(one, tmp_path / name)
        report = tmp_path / name / "rules.txt"
        command = [SYSTEM_PYTHON, "-c", RULES_CHECK, tmp_path / name / "optopad.kicad_pcb", report]
        subprocess.run(command, check=True, env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)})
        words = report.read_text()
        assert "Found 0 DRC violations" in words, (name, words)
        assert "Found 0 unconnected pads" in words, (name, words)


def test_a_part_that_no_circuit_reads_is_refused() -> None:
    layout = {"pattern": "grid", "kind": "coupler", "columns": 2, "rows": 2, "pitch_mm": 8.0, "apart_mm": 2.6}
    design = floor(layout, "vishay-vcnl4040-emitter", "vishay-vcnl4040-receiver")
    assert says(board_gaps(Circuit.of(design))[0], "vishay-vcnl4040-emitter ... I2C")


def test_the_screen_says_whether_a_board_is_finished(tmp_path: Path) -> None:
    assert board_words(tmp_path) == ""
    board = board_of(preset("piacenza2017-pair"))
    write_board(board, tmp_path / "fabrication" / "board")
    assert says(board_words(tmp_path), "every connection has a track")
    open_net = Unrouted(net="E1-K", start="E1-K", end="L1-1")
    write_board(replace(board, unrouted=(open_net,)), tmp_path / "fabrication" / "board")
    assert says(board_words(tmp_path), "1 of its connections has no track, of the nets E1-K")
    write_gaps(["mcp1: unknown"], tmp_path / "fabrication" / "board")
    assert says(board_words(tmp_path), "no board was made: mcp1: unknown")

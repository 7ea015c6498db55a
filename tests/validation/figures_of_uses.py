"""Figures of the simulated paper, of presets, learning and driver, each read from a stored result."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.validation.stored import ROOT, Figure, column, made, number, table, tables


def paper() -> Iterator[Figure]:
    """The paper's experiments, simulated."""
    page = "docs/validation/thickness.csv"
    rows = {float(row["cavity.clear_thickness_mm"]): row for row in tables(page)[0]}
    first = min(mm for mm, row in rows.items() if mm > 7 and row["verdict"] == "DEADBAND")
    yield made(page, "thickness.first", first, ".1f")
    yield made(page, "thickness.ten", float(rows[10.0]["shown_pair_deadband_mm"]), ".1f")
    yield made(page, "thickness.onset", float(rows[8.0]["mode2_onset_mm"]), ".1f")

    page = "docs/validation/reality.md"
    blocks = [rows for rows in tables(page) if rows and "today: ambient" in rows[0]]
    for name, block, ranges in (
        ("location", blocks[0], {"whole": (1, 5), "ratio": (0.5, 5)}),
        ("depth", blocks[1], {"ratio": (0.5, 3), "ratio.deep": (5, 5)}),
    ):
        for row in block:
            depth = row["depth mm"]
            if depth in ("1", "3", "5"):
                yield made(page, f"reality.{name}.{depth}", number(row["today: ambient"]), ".3f")
                yield made(page, f"reality.{name}.{depth}.paper", number(row["paper: ambient"]), ".3f")
        for shown, (first, last) in ranges.items():
            kept = [row for row in block if first <= number(row["depth mm"]) <= last]
            ratios = [
                number(row[f"today: {light}"].split("(")[1]) for row in kept for light in ("ambient", "dark")
            ]
            yield made(page, f"reality.{name}.{shown}.least", min(ratios), ".1f")
            yield made(page, f"reality.{name}.{shown}.most", max(ratios), ".1f")
    errors = table(page, "learner", "location: median")
    for learner in ("kernel-ridge", "extra-trees", "signal-map"):
        kept = [row for row in errors if row["learner"] == learner and number(row["depth mm"]) >= 1]
        medians = [number(one) for row in kept for one in row["location: median"].split("/")]
        digits = 1 if learner == "kernel-ridge" else 2
        yield made(page, f"reality.{learner}.least", min(medians), f".{digits}f")
        yield made(page, f"reality.{learner}.most", max(medians), f".{digits}f")
    for learner in ("kernel-ridge", "extra-trees", "signal-map"):
        (row,) = (row for row in errors if (row["learner"], row["depth mm"]) == (learner, "5"))
        yield made(page, f"reality.{learner}.deep", number(row["depth: median"]), ".2f")
    (free,) = (row for row in table(page, "true depth mm", "ambient") if row["true depth mm"] == "0 or less")
    yield made(page, "reality.false", 100 * number(free["ambient"]), ".1f")
    touch = {row["depth mm"]: row for row in table(page, "depth mm", "the paper", "kernel-ridge")}
    for depth in ("0.4", "1"):
        yield made(page, f"touch.{depth.replace('.', '_')}", number(touch[depth]["kernel-ridge"]), ".2f")
        yield made(page, f"touch.{depth.replace('.', '_')}.paper", number(touch[depth]["the paper"]), ".2f")
    off = [
        abs(number(one) - number(other))
        for row in touch.values()
        for one, other in zip(row["kernel-ridge"].split(" / "), row["the paper"].split(" / "), strict=True)
    ]
    yield made(page, "touch.off", max(off), ".2f")
    yield made(page, "touch.off.second", sorted(off)[-2], ".2f")
    heights = table(page, "LED mm", "median depth error at 5 mm")
    found = column(heights, "median depth error at 5 mm")
    yield made(page, "heights.least", min(found), ".2f")
    yield made(page, "heights.most", max(found), ".2f")
    page = "docs/validation/touch.md"
    at = column(table(page, "classifier", "0.4"), "0.4")[1:]
    yield made(page, "classifier.least", min(at), ".2f")
    yield made(page, "classifier.most", max(at), ".2f")


def presets() -> Iterator[Figure]:
    """What `score` and a quick prediction say of two presets."""
    page = "tests/validation/verdict/presets_table.md"
    scored = {(row["design"], row["settings"]): row for row in table(page, "design", "margin, sigma")}
    for name, settings in (("gripper", "score"), ("gripper.fine", "fine")):
        row = scored["gripper-stadium", settings]
        yield made(page, f"{name}.margin", row["margin, sigma"])
        yield made(page, f"{name}.unresolved", row["not resolved %"])
    row = scored["piacenza2017-pad", "score"]
    for name, head in (("location", "location bound mm"), ("depth", "depth bound mm")):
        yield made(page, f"pad.{name}", row[head])
    yield made(page, "pad.detected", row["detected from mm, worst location"])
    for name, head in (("force", "force at 0.6 mm: N"), ("force.low", "low"), ("force.high", "high")):
        yield made(page, f"pad.{name}", row[head])
    for end in ("low", "high"):
        off = 100 * (number(row[end]) / number(row["force at 0.6 mm: N"]) - 1)
        yield made(page, f"pad.band.{end}", off, "+.0f")
    predicted = {row["depth mm"]: row for row in table(page, "design", "location: median mm")}
    for depth in ("1", "2"):
        yield made(page, f"gripper.location.{depth}", number(predicted[depth]["location: median mm"]), ".1f")
    yield made(page, "gripper.found", predicted["1"]["found %"])


def learning() -> Iterator[Figure]:
    """Calibration, search and what learning costs."""
    page = "docs/validation/calibration.md"
    text = (ROOT / page).read_text("utf-8")
    blocks = [rows for rows in tables(page) if rows and "1 mm" in rows[0]]
    location, ratio = blocks[0], blocks[2]
    calibrated, drawn = (
        next(row for row in location if start in row[""]) for start in ("calibrated twin, 30", "as drawn")
    )
    ridge = next(row for row in location if "own four grid sets" in row[""])
    for depth in ("1 mm", "2 mm", "3 mm"):
        key = depth[0]
        yield made(page, f"calibration.{key}", number(calibrated[depth]), ".2f")
        yield made(page, f"calibration.{key}.ridge", number(ridge[depth]), ".2f")
    worse = [number(drawn[depth]) / number(calibrated[depth]) for depth in ("1 mm", "2 mm", "3 mm")]
    yield made(page, "calibration.drawn.least", min(worse), ".0f")
    yield made(page, "calibration.drawn.most", max(worse), ".0f")
    twin = next(row for row in ratio if row["median location error"].startswith("kernel ridge on the twin"))
    ratios = [number(twin[depth]) for depth in ("1 mm", "2 mm", "3 mm")]
    yield made(page, "calibration.twin.least", min(ratios), ".2f")
    yield made(page, "calibration.twin.most", max(ratios), ".2f")
    stated = re.search(r"over parameters and (?:builds|units): (\d+\.\d+)", text)
    if stated is not None:
        yield made(page, "calibration.stated", stated[1])
    index = next(
        row for row in table(page, "parameter", "off after (rms)") if "refractive_index" in row["parameter"]
    )
    yield made(page, "calibration.index", number(index["off after (rms)"]), ".3f")

    page = "docs/validation/search.md"
    ratios = table(page, "search", "figure", "smallest", "largest")
    off = [abs(number(row[end]) - 1) for row in ratios for end in ("smallest", "largest")]
    base, best = table(page, "design", "parts", "location_bound_mm")[:2]
    for name in ("location_bound_mm", "depth_bound_mm"):
        yield made(
            page, f"search.{name.removesuffix('_bound_mm')}", number(base[name]) / number(best[name]), ".2f"
        )
    yield made(page, "search.off", 100 * max(off), ".0f")

    page = "docs/validation/learning.md"
    (whole,) = (row for row in table(page, "samples", "memory GB") if row["samples"] == "24,000")
    yield made(page, "learning.seconds", number(whole["processor s"]), ".0f")
    yield made(page, "learning.memory", number(whole["memory GB"]), ".1f")


def memory() -> Iterator[Figure]:
    """What a pad keeps of a press."""
    page = "docs/validation/memory.md"
    (recorded,) = (row for row in table(page, "signal", "0.5 s") if row["signal"].startswith("recorded: all"))
    for name, head in (("soon", "0.5 s"), ("late", "6 s")):
        least, most = recorded[head].split(" to ")
        yield made(page, f"memory.{name}.least", least)
        yield made(page, f"memory.{name}.most", most)
    yield made(page, "memory.misfit", table(page, "law", "misfit %: median")[0]["misfit %: median"])
    loops = table(page, "taxel, depth", "signal: area of the loop %")
    for name, head in (("force", "force: area of the loop %"), ("light", "signal: area of the loop %")):
        yield made(page, f"memory.loop.{name}.least", min(column(loops, head)), ".1f")
        yield made(page, f"memory.loop.{name}.most", max(column(loops, head)), ".1f")
    touches = table(page, "pad", "learner", "found again after s")
    for name, pad in (("gripper", "gripper-teensy"), ("pad", "piacenza2017-pad")):
        times = column([row for row in touches if row["pad"] == pad], "found again after s")
        yield made(page, f"memory.{name}.least", min(times), ".1f")
        yield made(page, f"memory.{name}.most", max(times), ".1f")
        follows = [row for row in table(page, "board", "residue") if row["board"].startswith(pad)]
        with_memory = [row for row in follows if row["residue"] == "0.04"]
        yield made(
            page, f"memory.{name}.false", column(with_memory, "false touches end after ms")[0] / 1000, ".1f"
        )
        yield made(
            page, f"memory.{name}.held", column(with_memory, "untouched signals are held for s")[0], ".1f"
        )
        yield made(page, f"memory.{name}.moved", column(with_memory, "they move by at most %")[0], ".2f")


def driver() -> Iterator[Figure]:
    """Firmware and serial line."""
    page = "docs/validation/firmware.md"
    (pad,) = (row for row in table(page, "preset", "sum Hz") if row["preset"] == "piacenza2017-pad")
    yield made(page, "firmware.rate", number(pad["simulator Hz"]), ".0f")
    page = "docs/validation/link.md"
    rows = table(page, "line", "sent", "intact")
    yield made(page, "link.frames", sum(column(rows, "sent")) / 1e6, ".0f")
    yield made(page, "link.intact", min(column(rows, "of these delivered")), ".3f")
    page = "docs/validation/slip.md"
    rows = [row for row in table(page, "depth mm", "found in 30 ms %") if row["frames a second"] == "1000"]
    yield made(page, "slip.found", min(column(rows, "found in 30 ms %")), ".0f")
    yield made(page, "slip.delay", max(column(rows, "median ms")), ".0f")
    (presses,) = (row for row in table(page, "sensor", "false alarms") if row["frames a second"] == "1000")
    yield made(page, "slip.alarms", number(presses["false alarms"]), ".0f")
    yield made(page, "slip.minutes", number(presses["minutes"]), ".0f")


def scene() -> Iterator[Figure]:
    """The pad in MuJoCo against the models of contact and light."""
    page = "docs/validation/scene.md"
    rows = table(page, "pad", "g")
    forces = [abs(number(cell)) for row in rows for head, cell in row.items() if "mm" in head and cell != "-"]
    yield made(page, "scene.force", max(forces), ".1f")
    kinds = {
        row["kind of object"]: number(row["error %"]) for row in table(page, "kind of object", "error %")
    }
    yield made(page, "scene.light.tip", kinds.pop("ball like the tip"), ".2f")
    yield made(page, "scene.light.all", kinds.pop("all"), ".1f")
    yield made(page, "scene.light.worst", max(kinds.values()), ".1f")
    rows = table(page, "learner", "in the scene mm")
    yield made(page, "scene.ball", max(column(rows, "ratio")), ".2f")

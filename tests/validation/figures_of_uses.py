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
    yield made(page, "thickness.first", "thinnest layer from 7 mm on with a deadband", first, ".1f", "mm")
    yield made(
        page,
        "thickness.ten",
        "deadband of the middle pair at 10 mm",
        float(rows[10.0]["shown_pair_deadband_mm"]),
        ".1f",
        "mm",
    )
    yield made(
        page,
        "thickness.onset",
        "onset of mode 2 at 8 mm of layer",
        float(rows[8.0]["mode2_onset_mm"]),
        ".1f",
        "mm",
    )

    page = "docs/validation/reality.md"
    blocks = [rows for rows in tables(page) if rows and "today: ambient" in rows[0]]
    for name, block in (("location", blocks[0]), ("depth", blocks[1])):
        for row in block:
            depth = row["depth mm"]
            if depth not in ("1", "3", "5"):
                continue
            yield made(
                page,
                f"reality.{name}.{depth}",
                f"{name} error, {row['depth mm']} mm deep, ambient, kernel ridge, median",
                number(row["today: ambient"]),
                ".3f",
                "mm",
            )
            yield made(
                page,
                f"reality.{name}.{depth}.paper",
                "the same, published by the paper",
                number(row["paper: ambient"]),
                ".3f",
                "mm",
            )
        wide = [row for row in block if name == "location" and number(row["depth mm"]) >= 1]
        if wide:
            ratios = [
                number(row[f"today: {light}"].split("(")[1]) for row in wide for light in ("ambient", "dark")
            ]
            about = "location error over the paper's, 1 to 5 mm deep"
            yield made(page, "reality.location.whole.least", f"{about}, least", min(ratios), ".1f", "times")
            yield made(page, "reality.location.whole.most", f"{about}, largest", max(ratios), ".1f", "times")
        for shown, depths in (
            ("", ("0.5", "1", "2", "3") if name == "depth" else ("0.5", "1", "2", "3", "5")),
            (".deep", ("5",)),
        ):
            if name == "location" and shown:
                continue
            kept = [row for row in block if row["depth mm"] in depths]
            ratios = [
                number(row[f"today: {light}"].split("(")[1]) for row in kept for light in ("ambient", "dark")
            ]
            where = f"{depths[0]} to {depths[-1]} mm" if len(depths) > 1 else f"{depths[0]} mm"
            yield made(
                page,
                f"reality.{name}.ratio{shown}.least",
                f"{name} error over the paper's, {where} deep, least",
                min(ratios),
                ".1f",
                "times",
            )
            yield made(
                page,
                f"reality.{name}.ratio{shown}.most",
                f"{name} error over the paper's, {where} deep, largest",
                max(ratios),
                ".1f",
                "times",
            )
    errors = table(page, "learner", "location: median")
    for learner in ("kernel-ridge", "extra-trees", "signal-map"):
        kept = [row for row in errors if row["learner"] == learner and number(row["depth mm"]) >= 1]
        medians = [number(one) for row in kept for one in row["location: median"].split("/")]
        digits = 1 if learner == "kernel-ridge" else 2
        yield made(
            page,
            f"reality.{learner}.least",
            f"location error of {learner}, 1 to 5 mm deep, median, least",
            min(medians),
            f".{digits}f",
            "mm",
        )
        yield made(page, f"reality.{learner}.most", "the same, largest", max(medians), f".{digits}f", "mm")
    for learner in ("kernel-ridge", "extra-trees", "signal-map"):
        (row,) = (row for row in errors if (row["learner"], row["depth mm"]) == (learner, "5"))
        about = f"depth error of {learner}, 5 mm deep, ambient, median"
        yield made(page, f"reality.{learner}.deep", about, number(row["depth: median"]), ".2f", "mm")
    (free,) = (row for row in table(page, "true depth mm", "ambient") if row["true depth mm"] == "0 or less")
    about = "frames without contact that the signal map reports as touched, ambient"
    yield made(page, "reality.false", about, 100 * number(free["ambient"]), ".1f", "%")
    touch = {row["depth mm"]: row for row in table(page, "depth mm", "the paper", "kernel-ridge")}
    for depth in ("0.4", "1"):
        yield made(
            page,
            f"touch.{depth.replace('.', '_')}",
            f"share of touches found, {depth} mm deep, ambient, kernel ridge",
            number(touch[depth]["kernel-ridge"]),
            ".2f",
            "",
        )
        yield made(
            page,
            f"touch.{depth.replace('.', '_')}.paper",
            "the same, published by the paper",
            number(touch[depth]["the paper"]),
            ".2f",
            "",
        )
    off = [
        abs(number(one) - number(other))
        for row in touch.values()
        for one, other in zip(row["kernel-ridge"].split(" / "), row["the paper"].split(" / "), strict=True)
    ]
    yield made(
        page,
        "touch.off",
        "share of touches found against the paper's table, largest difference",
        max(off),
        ".2f",
        "",
    )
    yield made(page, "touch.off.second", "the same, second largest", sorted(off)[-2], ".2f", "")
    heights = table(page, "LED mm", "median depth error at 5 mm")
    found = column(heights, "median depth error at 5 mm")
    yield made(
        page, "heights.least", "depth error at 5 mm of the heights that agree, least", min(found), ".2f", "mm"
    )
    yield made(page, "heights.most", "the same, largest", max(found), ".2f", "mm")
    page = "docs/validation/touch.md"
    at = column(table(page, "classifier", "0.4"), "0.4")[1:]
    yield made(
        page,
        "classifier.least",
        "share of touches found at 0.4 mm, ambient, least of four classifiers",
        min(at),
        ".2f",
        "",
    )
    yield made(page, "classifier.most", "the same, largest", max(at), ".2f", "")


def presets() -> Iterator[Figure]:
    """What `score` and a quick prediction say of two presets."""
    page = "tests/validation/verdict/presets_table.md"
    scored = {(row["design"], row["settings"]): row for row in table(page, "design", "margin, sigma")}
    for name, key in (
        ("gripper", ("gripper-stadium", "score")),
        ("gripper.fine", ("gripper-stadium", "fine")),
    ):
        row = scored[key]
        about = f"{key[0]}, settings of {key[1]}"
        yield made(page, f"{name}.margin", f"{about}: margin", row["margin, sigma"], "", "sigma")
        yield made(page, f"{name}.unresolved", f"{about}: not resolved", row["not resolved %"], "", "%")
    row = scored["piacenza2017-pad", "score"]
    for name, head in (("location", "location bound mm"), ("depth", "depth bound mm")):
        yield made(page, f"pad.{name}", f"the paper's pad: {name} bound, median", row[head], "", "mm")
    head = "detected from mm, worst location"
    yield made(page, "pad.detected", "the paper's pad: contact is detected from", row[head], "", "mm")
    for name, head in (("force", "force at 0.6 mm: N"), ("force.low", "low"), ("force.high", "high")):
        about = f"the paper's pad: force at 0.6 mm of the contact model, {head.partition(': N')[0]}"
        yield made(page, f"pad.{name}", about, row[head], "", "N")
    for end in ("low", "high"):
        off = 100 * (number(row[end]) / number(row["force at 0.6 mm: N"]) - 1)
        yield made(page, f"pad.band.{end}", f"band of the force by the modulus, {end} end", off, "+.0f", "%")
    predicted = {row["depth mm"]: row for row in table(page, "design", "location: median mm")}
    for depth in ("1", "2"):
        error = number(predicted[depth]["location: median mm"])
        about = f"gripper-stadium, quick prediction: location error at {depth} mm, median"
        yield made(page, f"gripper.location.{depth}", about, error, ".1f", "mm")
    about = "gripper-stadium, quick prediction: presses of 1 mm that are found"
    yield made(page, "gripper.found", about, predicted["1"]["found %"], "", "%")


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
        yield made(
            page,
            f"calibration.{key}",
            f"location error after calibration, {depth} deep, median",
            number(calibrated[depth]),
            ".2f",
            "mm",
        )
        yield made(
            page,
            f"calibration.{key}.ridge",
            f"location error of kernel ridge on 484 presses, {depth} deep, median",
            number(ridge[depth]),
            ".2f",
            "mm",
        )
    worse = [number(drawn[depth]) / number(calibrated[depth]) for depth in ("1 mm", "2 mm", "3 mm")]
    yield made(
        page,
        "calibration.drawn.least",
        "location error without calibration over that with it, least",
        min(worse),
        ".0f",
        "times",
    )
    yield made(page, "calibration.drawn.most", "the same, largest", max(worse), ".0f", "times")
    twin = next(row for row in ratio if row["median location error"].startswith("kernel ridge on the twin"))
    ratios = [number(twin[depth]) for depth in ("1 mm", "2 mm", "3 mm")]
    yield made(
        page,
        "calibration.twin.least",
        "kernel ridge trained on the twin over the same on the unit, least",
        min(ratios),
        ".2f",
        "times",
    )
    yield made(page, "calibration.twin.most", "the same, largest", max(ratios), ".2f", "times")
    stated = re.search(r"over parameters and (?:builds|units): (\d+\.\d+)", text)
    if stated is not None:
        about = "errors of fitted parameters over the stated deviations, rms"
        yield made(page, "calibration.stated", about, stated[1], "", "times")
    index = next(
        row for row in table(page, "parameter", "off after (rms)") if "refractive_index" in row["parameter"]
    )
    yield made(
        page,
        "calibration.index",
        "error of the fitted refractive index, rms",
        number(index["off after (rms)"]),
        ".3f",
        "",
    )

    page = "docs/validation/search.md"
    ratios = table(page, "search", "figure", "smallest", "largest")
    off = [abs(number(row[end]) - 1) for row in ratios for end in ("smallest", "largest")]
    base, best = table(page, "design", "parts", "location_bound_mm")[:2]
    for name in ("location_bound_mm", "depth_bound_mm"):
        yield made(
            page,
            f"search.{name.removesuffix('_bound_mm')}",
            f"{name} of the paper's pad over the best design's",
            number(base[name]) / number(best[name]),
            ".2f",
            "times",
        )
    yield made(
        page,
        "search.off",
        "a search's figures against the score's, largest difference",
        100 * max(off),
        ".0f",
        "%",
    )

    page = "docs/validation/learning.md"
    (whole,) = (row for row in table(page, "samples", "memory GB") if row["samples"] == "24,000")
    yield made(
        page,
        "learning.seconds",
        "kernel ridge on 24,000 samples",
        number(whole["processor s"]),
        ".0f",
        "s",
    )
    yield made(
        page,
        "learning.memory",
        "kernel ridge on 24,000 samples",
        number(whole["memory GB"]),
        ".1f",
        "GB",
    )


def driver() -> Iterator[Figure]:
    """Firmware and serial line."""
    page = "docs/validation/firmware.md"
    (pad,) = (row for row in table(page, "preset", "sum Hz") if row["preset"] == "piacenza2017-pad")
    yield made(
        page,
        "firmware.rate",
        "frames of the paper's pad on a simulated board",
        number(pad["simulator Hz"]),
        ".0f",
        "frames a second",
    )
    page = "docs/validation/link.md"
    rows = table(page, "line", "sent", "intact")
    yield made(
        page,
        "link.frames",
        "frames sent through damaged lines",
        sum(column(rows, "sent")) / 1e6,
        ".0f",
        "million",
    )
    yield made(
        page,
        "link.intact",
        "intact frames delivered, least of four kinds of damage",
        min(column(rows, "of these delivered")),
        ".3f",
        "%",
    )

"""The specification of a sensor: all fields in which designs can differ.

A design is immutable; `with_` returns a changed copy. Its `digest` depends on its content, and not on the formatting of
its file. All lengths are in mm in the cavity's coordinate system (`optopad.design.shape.cavity`).

Some fields describe how the signals of a manufactured unit deviate from ideal ones: noise, drift, ambient light, errors
of the test stage, and silicone that comes off the walls. The signal chain (`optopad.sims.readings.signal_chain`)
simulates them.

Noise is described in two ways for two purposes, which are never added together:

- for the verdict (`optopad score`): variance of a reading = 1/12 + read² + (relative x counts)²
- for the signal chain: every cause separately, with its own time scale and correlations

Both use `read_noise_counts`. For the verdict, `relative_noise` (0.3 %) summarises all noise in proportion to the
signal. The signal chain uses `led_fluctuation` and `gain_drift` in its place, 0.2 % each and 0.28 % combined. The chain
rounds readings as the converter does; the verdict represents this rounding by the variance 1/12.

Sources of the defaults: "bounded" values are limited by the touch table of the paper (Piacenza et al., 2017) at depths
without contact. "Assumed" values have no source.
"""

from __future__ import annotations

import hashlib
import json
import math
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from optopad.design.errors import DesignError
from optopad.design.fields.base import (
    FileName,
    Model,
    PartId,
    is_value,
    known_paths,
    known_values,
    set_at,
    unknown_path,
)
from optopad.design.fields.validation import design_error
from optopad.design.parts.catalog import CatalogEntries, identifiers
from optopad.design.spec.indenter import Indenter, shape_fault
from optopad.design.spec.layout import BY_ANGLE, BY_WALL, FLOOR, ON_FLOOR, Pattern, expand
from optopad.design.spec.pad import Cavity, Covering, Crown
from optopad.design.toml_text import require_plain

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Offset = Annotated[float, Field(ge=0.0, le=2.0)]

CHAIN = (
    "quantised",
    "dark_counts",
    "shot_variance_per_count",
    "led_fluctuation",
    "gain_drift",
    "gain_drift_per_hour",
    "ambient_counts",
    "ambient_flicker",
    "flicker_hz",
    "zero_offset_set_mm",
    "zero_offset_place_mm",
    "retract_lag_mm",
    "position_error_mm",
    "wall_unbonded_share",
    "wall_heal_s",
    "release_residue",
    "release_decay_s",
)
"""Names of the noise parameters that only the signal chain uses."""

PURE: dict[str, Any] = {
    "read_noise_counts": 0.0,
    "quantised": False,
    "dark_counts": 0.0,
    "shot_variance_per_count": 0.0,
    "led_fluctuation": 0.0,
    "gain_drift": 0.0,
    "gain_drift_per_hour": 0.0,
    "ambient_counts": 0.0,
    "zero_offset_set_mm": 0.0,
    "zero_offset_place_mm": 0.0,
    "retract_lag_mm": 0.0,
    "position_error_mm": 0.0,
    "wall_unbonded_share": 0.0,
    "release_residue": 0.0,
}
"""Values of the noise parameters that switch all deviations off, so only gain, light and full scale remain."""


class Noise(Model):
    """Noise of a reading, and other deviations from the ideal light signal (docs/how-to/simulate-data-set.md)."""

    unsaid = CHAIN

    read_noise_counts: Annotated[
        float,
        Field(
            ge=0.0, le=100.0, description="of one reading in the dark, without rounding; verdict and chain"
        ),
    ] = 0.5
    relative_noise: Annotated[
        float,
        Field(ge=0.0, le=0.5, description="verdict only: total noise in proportion to the signal"),
    ] = 0.003
    quantised: Annotated[bool, Field(description="readings are whole counts; false: for studies only")] = True
    dark_counts: Annotated[
        float,
        Field(
            ge=0.0,
            le=1e4,
            description="reading without any light: amplifier offset, dark current; assumed: 5 mV, one count",
        ),
    ] = 1.0
    shot_variance_per_count: Annotated[
        float | None,
        Field(
            ge=0.0,
            le=100.0,
            description="shot noise: variance of a reading over its counts; left out: from the amplifier's feedback",
        ),
    ] = None
    led_fluctuation: Annotated[
        Share,
        Field(
            description="standard deviation of an emitter's power from frame to frame, equal for all "
            "receivers; bounded"
        ),
    ] = 0.002
    gain_drift: Annotated[
        Share,
        Field(description="standard deviation of each part's gain from data set to data set; bounded"),
    ] = 0.002
    gain_drift_per_hour: Annotated[
        Share,
        Field(
            description=(
                "standard deviation of each part's linear drift within a set; 0, because no source gives a value"
            )
        ),
    ] = 0.0
    ambient_counts: Annotated[
        float,
        Field(
            ge=0.0,
            le=1e5,
            description="ambient light on every receiver in ambient sets, before its subtraction; assumed",
        ),
    ] = 20.0
    ambient_flicker: Annotated[
        Share,
        Field(
            description="amplitude of the lamps' flicker over ambient light; assumed: with ambient_counts it leaves a "
            "residual of about a count, as bounded"
        ),
    ] = 0.05
    flicker_hz: Annotated[
        float,
        Field(
            gt=0.0,
            le=1e6,
            description="frequency of the flicker: twice the mains', 120 in New York, else 100",
        ),
    ] = 120.0
    zero_offset_set_mm: Annotated[
        Offset,
        Field(
            description="standard deviation of the reference depth from set to set, as zeroed by hand; bounded"
        ),
    ] = 0.04
    zero_offset_place_mm: Annotated[
        Offset,
        Field(description="standard deviation of the reference depth from location to location; bounded"),
    ] = 0.03
    retract_lag_mm: Annotated[
        Offset,
        Field(
            description="backlash: how much deeper the tip is than the stage reports in retraction; bounded"
        ),
    ] = 0.05
    position_error_mm: Annotated[
        Offset,
        Field(
            description="standard deviation of the tip's x and y from press to press; assumed: a screw stage"
        ),
    ] = 0.02
    wall_unbonded_share: Annotated[
        Share,
        Field(
            description="share of the wall that the deepest press detaches; 0, because the paper reports "
            "the effect without a figure"
        ),
    ] = 0.0
    wall_heal_s: Annotated[
        float,
        Field(gt=0.0, le=1e6, description="time constant of the wall's rebonding; the paper: 5 to 10 s"),
    ] = 7.5
    release_residue: Annotated[
        Share,
        Field(
            description="share of the last press's signal change that remains right after its release; 0, because no "
            "source measured a clear silicone; 0.04 in another one"
        ),
    ] = 0.0
    release_decay_s: Annotated[
        float,
        Field(
            gt=0.0,
            le=1e6,
            description="time from a release until half of its residue is left; 0.7 to 1.4 in another silicone",
        ),
    ] = 1.0


SCHEMA_VERSION = 1

Ohm = Annotated[float, Field(ge=100.0, le=1e10)]
"""Feedback resistance of an amplifier [ohm]."""


class Mold(Model):
    """The printed part around the cavity, with the same outline; around a disc it is given by its diameter."""

    unsaid = (
        "outer_diameter_mm",
        "label",
        "fits",
        "numbers",
        "strain_relief",
        "raised_sockets",
        "cover_ledge_mm",
        "pieces",
    )

    outer_length_mm: Annotated[float, Field(ge=6.0, le=400.0, description="outside along x, not of a disc")]
    outer_width_mm: Annotated[float, Field(ge=6.0, le=400.0, description="outside along y, not of a disc")]
    outer_diameter_mm: Annotated[
        float | None, Field(ge=6.0, le=400.0, description="outside of the mold of a disc")
    ] = None
    floor_mm: Annotated[float, Field(ge=0.6, le=30.0, description="thickness below the black layer")] = 3.0
    rim_mm: Annotated[
        float,
        Field(
            ge=0.0,
            le=20.0,
            description="wall above the clear layer: its lip shows the fill level, blade and gauge rest on it, and "
            "1.5 mm cover the bodies of the paper's photodiodes, 1.45 mm above the layer; a flat object larger than "
            "the pad touches it only at 0, with bodies below the surface",
        ),
    ] = 1.5
    fixing_hole_diameter_mm: Annotated[
        float, Field(ge=0.0, le=20.0, description="corner holes; 0 for none")
    ] = 3.2
    fixing_hole_inset_mm: Annotated[
        float, Field(ge=0.0, le=50.0, description="hole centre to both outer faces")
    ] = 3.25
    part_clearance_mm: Annotated[
        float, Field(ge=0.0, le=1.0, description="gap around a part's body, each side")
    ] = 0.15
    lead_clearance_mm: Annotated[
        float, Field(ge=0.0, le=1.0, description="added to a lead's diameter for its hole")
    ] = 0.3
    min_web_mm: Annotated[float, Field(ge=0.2, le=5.0, description="thinnest wall the printer makes")] = 0.8
    material: Annotated[PartId, Field(description="catalogue entry of the printed material")] = "abs-black"
    label: Annotated[
        str,
        Field(
            max_length=40,
            pattern=r"^[A-Za-z0-9 ._+/-]*$",
            description="text sunk into the underside; letters are printed as capitals",
        ),
    ] = ""
    fits: Annotated[
        dict[PartId, Literal["press", "slip"]],
        Field(
            default_factory=dict,
            max_length=200,
            description="fit class of a part, instead of part_clearance_mm: press holds it, slip lets it drop in",
        ),
    ]
    numbers: Annotated[
        Literal["engraved", "none"],
        Field(
            description=(
                "engraves the names of the parts, as in the wiring table, in the outer face next to their sockets"
            )
        ),
    ] = "engraved"
    strain_relief: Annotated[
        Literal["pinch", "none"],
        Field(
            description="pinch: wire slots end in a neck that holds the insulation; leads leave in a channel below"
        ),
    ] = "pinch"
    raised_sockets: Annotated[
        bool, Field(description="walls around a body that is taller than the rim, up to its top")
    ] = True
    cover_ledge_mm: Annotated[
        float,
        Field(ge=0.0, le=10.0, description="seat of a glass cover at the fill level, its width; 0 for none"),
    ] = 0.0
    pieces: Annotated[
        Literal["one", "frame_and_base"],
        Field(description="frame_and_base: parted at the cavity's floor, held by the fixing holes' screws"),
    ] = "one"

    @property
    def outside_fields(self) -> tuple[str, str]:
        """Dotted paths of the fields for the outer size along x and along y; both are the diameter if it is round."""
        own = ("length", "width") if self.outer_diameter_mm is None else ("diameter",) * 2
        return f"mold.outer_{own[0]}_mm", f"mold.outer_{own[1]}_mm"

    @model_validator(mode="before")
    @classmethod
    def _diameter_stands_for_both(cls, given: Any) -> Any:
        if not isinstance(given, dict) or given.get("outer_diameter_mm") is None:
            return given
        extra = [name for name in ("outer_length_mm", "outer_width_mm") if name in given]
        if extra:
            raise ValueError(f"outer_diameter_mm replaces {' and '.join(extra)}: give either")
        across = given["outer_diameter_mm"]
        return {**given, "outer_length_mm": across, "outer_width_mm": across}

    def _outlined(self, document: dict[str, Any]) -> dict[str, Any]:
        if self.outer_diameter_mm is not None:
            del document["outer_length_mm"], document["outer_width_mm"]
        return document


class Viscoelastic(Model):
    """Relaxation of the load at constant depth. There are no default values because no source gives any."""

    relaxed_share: Annotated[
        float,
        Field(ge=0.0, le=0.95, description="share of the instantaneous modulus that relaxes away"),
    ]
    time_constant_s: Annotated[
        float, Field(gt=0.0, le=1e6, description="of the relaxation after a step in depth")
    ]


class Elastomer(Model):
    """The clear elastomer. A value given here replaces the catalogue's and counts as measured."""

    unsaid = ("viscoelastic",)

    material: Annotated[PartId, Field(description="catalogue entry of the clear silicone")] = "sylgard-184"
    mixing_ratio: Annotated[float, Field(gt=0.0, le=100.0, description="base over curing agent by weight")]
    refractive_index: Annotated[
        float | None, Field(ge=1.0, le=2.5, description="refractive index, in place of the catalogue's")
    ] = None
    absorption_db_per_cm: Annotated[
        float | None, Field(ge=0.0, le=50.0, description="absorption of light, in place of the catalogue's")
    ] = None
    youngs_modulus_mpa: Annotated[
        float | None,
        Field(
            gt=0.0,
            le=100.0,
            description="Young's modulus, in place of the catalogue's; it scales force alone",
        ),
    ] = None
    viscoelastic: Annotated[
        Viscoelastic | None,
        Field(description="viscoelastic load, in the load protocol only; absent: elastic"),
    ] = None


class Surfaces(Model):
    """Diffuse (Lambertian) reflectance of every surface that light reaches [-], and the finish of the walls."""

    unsaid = ("wall_finish", "wall_index")

    wall_reflectance: Annotated[
        float, Field(ge=0.0, le=0.99, description="share of the light that walls scatter")
    ] = 0.05
    bottom_reflectance: Annotated[
        float, Field(ge=0.0, le=0.99, description="share of the light that the bottom scatters")
    ] = 0.03
    tip_reflectance: Annotated[
        float, Field(ge=0.0, le=0.99, description="share of the light that the tip scatters")
    ] = 0.0
    wall_finish: Annotated[
        Literal["diffuse", "glossy", "air_gap"],
        Field(
            description="diffuse: walls scatter only; glossy: a smooth bonded face also mirrors by "
            "Fresnel; air_gap: the elastomer is not bonded, and its own face mirrors"
        ),
    ] = "diffuse"
    wall_index: Annotated[
        float | None,
        Field(ge=1.0, le=2.5, description="glossy: index of the wall; the mold material's if left out"),
    ] = None


class Emitters(Model):
    """Defaults of all emitters; an entry of the layout may override them."""

    unsaid = ("height_mm",)

    part: Annotated[PartId, Field(description="catalogue entry of every emitter")]
    height_mm: Annotated[
        float | None,
        Field(
            gt=0.0, le=50.0, description="walls: centre of the emitting area above the clear layer's bottom"
        ),
    ] = None


class Receivers(Model):
    """Defaults of all receivers; an entry of the layout may override them."""

    unsaid = ("height_mm",)

    part: Annotated[PartId, Field(description="catalogue entry of every receiver")]
    height_mm: Annotated[
        float | None,
        Field(gt=0.0, le=50.0, description="walls: centre of the active area above the clear layer's bottom"),
    ] = None


class ReceiverInputs(Model):
    """Multiplexers between the receivers' amplifiers and the board's inputs, or converters in place of these inputs.

    All multiplexers share the address lines. All converters share the SPI bus, and each has its own chip select.
    """

    unsaid = ("converter", "select_pins")

    multiplexer: Annotated[PartId | None, Field(description="catalogue entry, as 74hc4067")] = None
    address_pins: Annotated[
        tuple[Annotated[int, Field(ge=0, le=200)], ...] | None,
        Field(max_length=8, description="digital pins of the address, lowest bit first"),
    ] = None
    converter: Annotated[PartId | None, Field(description="catalogue entry, as mcp3208 or ads8688")] = None
    select_pins: Annotated[
        tuple[Annotated[int, Field(ge=0, le=200)], ...] | None,
        Field(max_length=32, description="digital pins of the converters' chip selects, in their order"),
    ] = None

    @model_validator(mode="after")
    def _has_one_circuit(self) -> Self:
        _require_one("multiplexer", self.multiplexer, "converter", self.converter)
        _require_owner("address_pins", self.address_pins, "multiplexer", self.multiplexer)
        _require_owner("select_pins", self.select_pins, "converter", self.converter)
        return self


class EmitterOutputs(Model):
    """Shift registers in a chain that switch the emitters, or LED drivers in a chain on the SPI bus."""

    unsaid = ("driver",)

    shift_register: Annotated[PartId | None, Field(description="catalogue entry, as 74hc595")] = None
    driver: Annotated[
        PartId | None, Field(description="catalogue entry of a constant-current driver, as tlc5947")
    ] = None
    pins: Annotated[
        tuple[Annotated[int, Field(ge=0, le=200)], ...] | None,
        Field(
            min_length=2,
            max_length=3,
            description="digital pins of shift registers: data, clock and latch; of LED drivers: latch and blank",
        ),
    ] = None

    @model_validator(mode="after")
    def _has_one_circuit(self) -> Self:
        _require_one("shift_register", self.shift_register, "driver", self.driver)
        return self


def _require_one(first: str, first_id: str | None, second: str, second_id: str | None) -> None:
    if (first_id is None) == (second_id is None):
        given = "neither is given" if first_id is None else f"both are given, {first_id} and {second_id}"
        way_out = f"name a {first} or a {second}" if first_id is None else f"remove {first} or {second}"
        raise ValueError(f"{first} and {second}: {given}; one of them is needed: {way_out}")


def _require_owner(pins: str, given: tuple[int, ...] | None, owner: str, owner_id: str | None) -> None:
    if given is not None and owner_id is None:
        raise ValueError(f"{pins} = {list(given)} are pins of a {owner}, and none is named; remove {pins}")


class BoardUse(Model):
    """The microcontroller board and its settings; pins and inputs are assigned in the board's order by default."""

    unsaid = ("receivers", "emitters", "amplifier", "transistor", "averages", "reference", "dark")

    kind: Annotated[PartId, Field(description="catalogue entry of the board")] = "arduino-mega-2560"
    emitter_pins: Annotated[
        tuple[Annotated[int, Field(ge=0, le=200)], ...] | None,
        Field(max_length=200, description="one digital pin per emitter"),
    ] = None
    receiver_channels: Annotated[
        tuple[Annotated[str, Field(max_length=60)], ...] | None,
        Field(
            max_length=200, description="one analogue input per receiver, or per multiplexer: 'A0', 'A1' ..."
        ),
    ] = None
    receivers: Annotated[
        ReceiverInputs | None, Field(description="multiplexers or converters; absent: one input a receiver")
    ] = None
    emitters: Annotated[
        EmitterOutputs | None, Field(description="shift registers or LED drivers; absent: one pin an emitter")
    ] = None
    amplifier: Annotated[
        PartId | None,
        Field(description="amplifiers of the receivers; absent: the slowest that settles in time"),
    ] = None
    transistor: Annotated[
        PartId | None,
        Field(description="transistors of the emitters; absent: the smallest that carries their current"),
    ] = None
    adc_prescaler: Annotated[int, Field(description="AVR boards: ADC clock = board clock / prescaler")] = 64
    settle_us: Annotated[
        float, Field(ge=0.0, le=10000.0, description="waiting time after an emitter is switched")
    ] = 20.0
    reference: Annotated[
        Literal["supply", "internal"],
        Field(description="full scale of the converter: its supply, or the board's internal reference"),
    ] = "supply"
    averages: Annotated[
        int, Field(ge=1, le=256, description="readings of which the board sends the mean as one value")
    ] = 1
    dark: Annotated[
        Literal["frame", "each"],
        Field(
            description="dark state: one at the end of a frame, or one before and one after each emitter's state"
        ),
    ] = "frame"
    baud: Annotated[int, Field(ge=1200, le=4000000, description="rate of the serial line, bits a second")] = (
        1000000
    )
    frame_rate_hz: Annotated[
        float, Field(ge=0.001, le=1e5, description="required number of full frames per second")
    ] = 60.0


class Gain(Model):
    """Transimpedance gain of the receivers' amplifiers, by a rule or in ohms.

    The rules use the untouched signals of the judged pairs, in which a press can come between emitter and receiver. In
    facing rows these are the facing pairs. With the rule `each`, every receiver has its own gain: the median over its
    judged pairs equals `target_counts`. This gain is lower if a pair would otherwise exceed three quarters of full
    scale. With `common`, all receivers have the same gain, and the median over all judged pairs equals the target. With
    a resistance in ohms, the signals depend on the emitters' power. With `common` or ohms, bright pairs may clip at
    full scale; the results list them.
    """

    unsaid = ("feedback_ohm",)

    target_counts: Annotated[
        float,
        Field(
            gt=0.0,
            le=65535.0,
            description="reading of the median judged pair without contact; the gain rule does not exceed it",
        ),
    ] = 300.0
    feedback_ohm: Annotated[
        Ohm | tuple[Ohm, ...] | Literal["common", "each"],
        Field(description="a rule, one resistance for all receivers, or one for each in their order"),
    ] = "each"


class Operating(Model):
    """The range of depths and press locations that the verdict covers."""

    max_depth_mm: Annotated[float, Field(ge=0.1, le=30.0, description="deepest press")] = 5.0
    workspace_margin_mm: Annotated[
        float, Field(ge=0.0, le=50.0, description="tip's edge to the wall at the workspace's border")
    ] = 3.0


NOT_OF_MOLD = {"description", "measured", "surfaces", "board", "noise", "gain"}
"""Parts of a design on which no printed part depends."""
NOT_OF_SURFACE = {"name", "description", "measured", "board", "noise", "gain"}
"""Parts of a design on which no pressed surface depends."""


class SensorDesign(Model):
    """Complete specification of one sensor."""

    unsaid = ("tolerances", "crown", "top")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")]
    name: Annotated[
        FileName,
        Field(description="letters, digits, dot, dash and underscore; the bundle's folder begins with it"),
    ]
    description: Annotated[str, Field(description="free text, one line")] = ""
    measured: Annotated[
        tuple[Annotated[str, Field(max_length=200)], ...],
        Field(
            max_length=1000,
            description="dotted paths of values in this file that were measured on the built pad",
        ),
    ] = ()
    cavity: Cavity
    crown: Annotated[Crown | None, Field(description="a convex top; absent: flat")] = None
    top: Annotated[Covering | None, Field(description="a skin on the top; absent: bare")] = None
    mold: Mold
    elastomer: Elastomer
    surfaces: Surfaces = Surfaces()
    emitters: Emitters
    receivers: Receivers
    layout: Annotated[tuple[Pattern, ...], Field(min_length=1, max_length=128)]
    indenter: Indenter = Indenter()
    board: BoardUse = BoardUse()
    noise: Noise = Noise()
    gain: Gain = Gain()
    operating: Operating = Operating()
    part_measurements: Annotated[
        dict[PartId, Annotated[dict[str, float], Field(min_length=1, max_length=100)]],
        Field(
            default_factory=dict,
            max_length=200,
            description="measured values that replace a catalogue part's: part, then field = value",
        ),
    ]
    tolerances: Annotated[
        dict[
            Annotated[str, Field(min_length=1, max_length=200)],
            Annotated[float, Field(ge=0.0, le=100.0)],
        ],
        Field(
            default_factory=dict,
            max_length=64,
            description="manufacturing tolerance of a value: dotted path = half width in its unit, 0 for "
            "exact; replaces the band or the default of that value",
        ),
    ]
    catalog: Annotated[
        CatalogEntries,
        Field(description="the user's own parts and materials, in addition to the packaged ones"),
    ] = CatalogEntries()

    @model_validator(mode="after")
    def _measured_paths_lead_to_values(self) -> Self:
        document = self.model_dump(mode="json")
        for path in self.measured:
            if not is_value(document, path):
                raise ValueError(f"measured: {unknown_path(path, known_values(type(self)))}")
        return self

    @model_validator(mode="after")
    def _tip_has_a_shape(self) -> Self:
        fault = shape_fault(self.indenter)
        if fault is not None:
            raise ValueError(fault)
        return self

    @model_validator(mode="after")
    def _layout_fits_its_outline(self) -> Self:
        if (self.mold.outer_diameter_mm is None) == (self.cavity.outline == "disc"):
            raise ValueError(
                (
                    "mold.outer_diameter_mm: a disc's mold is round; give it instead of outer_length_mm and "
                    "outer_width_mm"
                )
                if self.cavity.outline == "disc"
                else "mold.outer_diameter_mm: belongs to a disc; give outer_length_mm and "
                "outer_width_mm, or set cavity.outline = 'disc'"
            )
        size, mold = self.cavity, self.mold
        if size.outline == "stadium":
            if (size.length_mm > size.width_mm) != (mold.outer_length_mm > mold.outer_width_mm):
                raise ValueError(
                    f"mold.outer_length_mm: {mold.outer_length_mm:g} x {mold.outer_width_mm:g} mm run across a "
                    f"stadium of {size.length_mm:g} x {size.width_mm:g} mm; the longer sides run along each other"
                )
            if self.crown is not None:
                raise ValueError(
                    "crown: the top of a stadium is flat, no lid is made for another; leave [crown] out, or use the "
                    "outline 'rectangle' or 'disc'"
                )
        for number, pattern in enumerate(self.layout):
            fault = self._misfit(pattern)
            if fault is not None:
                raise ValueError(
                    f"layout.{number}.pattern: '{pattern.pattern}' does not fit the outline, {fault}"
                )
        return self

    @model_validator(mode="after")
    def _wall_parts_have_a_height(self) -> Self:
        for place in expand(self.layout, self.cavity):
            section = self.emitters if place.kind == "emitter" else self.receivers
            if place.wall != FLOOR and place.height_mm is None and section.height_mm is None:
                raise ValueError(
                    f"{place.kind}s.height_mm is missing: {place.name} in the {place.wall} wall needs it; add it"
                )
        return self

    def _misfit(self, pattern: Pattern) -> str | None:
        """Reason why a pattern does not fit the outline, and a pattern to use in its place; None if it fits."""
        outline, walls = self.cavity.outline, self.cavity.walls
        for place in expand((pattern,), self.cavity):
            if place.wall == FLOOR:
                continue
            if place.angle_deg is not None and not self.cavity.has_round_walls:
                return f"a {outline} has no angles; use {_or_of((*BY_WALL, *ON_FLOOR))}"
            if place.angle_deg is None and place.wall not in walls:
                have = f"wall '{place.wall}', only {_or_of(tuple(walls))}" if walls else "walls"
                return f"a {outline} has no straight {have}; use {_or_of((*BY_ANGLE, *ON_FLOOR))}"
        return None

    @cached_property
    def is_on_board(self) -> bool:
        """Whether all parts are on the floor, a circuit board, so that the mold is a frame around it."""
        walls = {place.wall for place in expand(self.layout, self.cavity)}
        return walls == {FLOOR}

    @property
    def noise_inside(self) -> Noise:
        """The noise, without ambient light if a black coat outside the top keeps it out."""
        if self.top is None or not self.top.black_outside:
            return self.noise
        return self.noise.model_copy(update={"ambient_counts": 0.0})

    @property
    def value_noise_counts(self) -> float:
        """Read noise (standard deviation) of a frame's values, each the mean of `board.averages` readings [counts]."""
        return self.noise.read_noise_counts / math.sqrt(self.board.averages)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content as 64 hexadecimal digits, independent of formatting and key order."""
        return self._digest_without(set())

    @cached_property
    def mold_digest(self) -> str:
        """SHA-256 of all content but `NOT_OF_MOLD`: designs with equal ones have equal printed parts."""
        return self._digest_without(NOT_OF_MOLD)

    @cached_property
    def surface_digest(self) -> str:
        """SHA-256 of all content but `NOT_OF_SURFACE`: designs with equal ones have equal pressed surfaces."""
        return self._digest_without(NOT_OF_SURFACE)

    def _digest_without(self, parts: set[str]) -> str:
        return hashlib.sha256(
            canonical_json(self.model_dump(mode="json", exclude=parts)).encode()
        ).hexdigest()

    def with_ball(self) -> Self:
        """A copy whose tip is a ball of its tip's radius; the design itself if it is one already."""
        ball = Indenter(tip_radius_mm=self.indenter.tip_radius_mm)
        return self if self.indenter.shape == ball.shape else self.model_copy(update={"indenter": ball})

    def with_(self, **changes: Any) -> Self:
        """Return a copy with new values at dotted paths, such as ``with_(**{"cavity.clear_thickness_mm": 10})``.

        Raises
        ------
        DesignError : a path is unknown (the message suggests similar ones), or a value is not valid.
        """
        document = self.model_dump(mode="json")
        for path, value in changes.items():
            set_at(document, path, value, known=known_paths(type(self)))
        return self.from_document(document, where=self.name)

    @classmethod
    def from_document(cls, document: dict[str, Any], *, where: str) -> Self:
        """Make a design from nested plain data; `where` names their origin in error messages.

        Raises
        ------
        DesignError : invalid fields; the message lists each with its limit and a remedy.
        """
        try:
            require_plain(document)
        except ValueError as err:
            raise DesignError(f"{where}: {err}") from None
        try:
            return cls.model_validate_json(json.dumps(document, default=str), strict=True)
        except ValidationError as err:
            raise design_error(err, where, known_paths(cls), identifiers(document)) from None


def canonical_json(document: Any) -> str:
    """JSON text that is the same for equal content: sorted keys, no spaces, shortest form of floats."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def _or_of(names: tuple[str, ...]) -> str:
    return " or ".join(f"'{name}'" for name in sorted(names))

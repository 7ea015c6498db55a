"""What stands between light and counts on a built sensor: noise, drift, ambient light, the stage, the walls' bond.

Two descriptions of one noise, for two purposes, never added together:

- the verdict's (`optopad score`): variance of a reading = 1/12 + read² + (relative x counts)², one number a reading;
- the signal chain's (`sims.readings.chain`): every cause by itself, with its own time scale and its own correlations.

`read_noise_counts` is in both. `relative_noise` is the verdict's summary of all that is proportional to the signal; the
chain has `led_fluctuation` and `gain_drift` in its place, 0.2 % each, which together are 0.28 %: the 0.3 % of the
summary. The converter's rounding, 1/12 in the summary, is done in the chain.

Sources: "bounded" values are those that the paper's touch table at untouched depths allows (feasibility study of
the whole chain); "assumed" ones have no source at all.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from design.fields.base import Model

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
)
"""Parameters of the signal chain alone."""

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
}
"""Everything of the signal chain off: what is left is the gain times the light, and full scale."""


class Noise(Model):
    """Noise of a reading, and what else keeps readings from the light: docs/how-to/simulate-data-set.md."""

    unsaid = CHAIN

    read_noise_counts: Annotated[
        float,
        Field(
            ge=0.0, le=100.0, description="of one reading in the dark, without rounding; verdict and chain"
        ),
    ] = 0.5
    relative_noise: Annotated[
        float,
        Field(
            ge=0.0, le=0.5, description="verdict only: all noise in proportion to the signal, in one number"
        ),
    ] = 0.003
    quantised: Annotated[bool, Field(description="readings are whole counts; false: only for study")] = True
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
            description="standard deviation of an emitter's power from frame to frame, all receivers alike; bounded"
        ),
    ] = 0.002
    gain_drift: Annotated[
        Share,
        Field(description="standard deviation of each part's gain from data set to data set; bounded"),
    ] = 0.002
    gain_drift_per_hour: Annotated[
        Share,
        Field(
            description="standard deviation of each part's steady drift within a set; 0, because no source gives any"
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
        Field(description="standard deviation of the reference depth from set to set, set by hand; bounded"),
    ] = 0.04
    zero_offset_place_mm: Annotated[
        Offset,
        Field(description="standard deviation of the reference depth from place to place; bounded"),
    ] = 0.03
    retract_lag_mm: Annotated[
        Offset,
        Field(
            description="how much deeper the tip is than the stage says on its way back: backlash; bounded"
        ),
    ] = 0.05
    position_error_mm: Annotated[
        Offset,
        Field(
            description="standard deviation in x and in y of the tip's place, press by press; assumed: a screw stage"
        ),
    ] = 0.02
    wall_unbonded_share: Annotated[
        Share,
        Field(
            description="share of the wall that the deepest press unbonds; 0, because the paper says that it happens "
            "and not how much"
        ),
    ] = 0.0
    wall_heal_s: Annotated[
        float,
        Field(gt=0.0, le=1e6, description="time constant of the wall's healing; the paper: 5 to 10 s"),
    ] = 7.5

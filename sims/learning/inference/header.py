"""The header of a model file: kind of model, design, and training data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError

LARGEST_NUMBER = 1e30
"""Largest number in a model file: well within single precision, in which many of its arrays are stored."""
FORMAT = "optopad-model"
VERSION = 1


@dataclass(frozen=True, kw_only=True)
class ForceCurve:
    """Force against depth of a press in the middle of the pad, away from the walls.

    Attributes
    ----------
    depth_mm : increasing depths, the first of them 0 [mm]
    force_n : force at these depths [N]
    relative_sigma : standard error of the modulus, and so of every force, over its value [-]; 0 if it is not known
    """

    depth_mm: tuple[float, ...]
    force_n: tuple[float, ...]
    relative_sigma: float = 0.0

    def at(self, depth_mm: FloatArray) -> FloatArray:
        """Force (n,) at depths (n,) [N]: interpolated linearly, 0 above the surface, constant beyond the deepest."""
        return np.interp(depth_mm, self.depth_mm, self.force_n, left=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelHeader:
    """Description of a trained model.

    Attributes
    ----------
    kind : kind of model, named after the learner that trained it
    design_digest : digest of the design of the sensor that recorded the training data; None if unknown
    emitter_names, receiver_names : names of the components; features are in the order E1-R1, E1-R2, ...
    untouched_counts : (pair,) mean signals of the training frames without contact, to detect drift [counts]
    trained_on : facts about the training data: data sets, numbers of samples and locations, data left out
    settings : settings of the fit, both given and chosen by it
    created_with : versions of the software that trained the model
    force_curve : force against depth; None if the design was not available
    """

    kind: str
    design_digest: str | None
    emitter_names: tuple[str, ...]
    receiver_names: tuple[str, ...]
    untouched_counts: FloatArray
    trained_on: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    created_with: Mapping[str, str] = field(default_factory=dict)
    force_curve: ForceCurve | None = None
    format: str = FORMAT
    version: int = VERSION

    @property
    def pair_names(self) -> tuple[str, ...]:
        """Names of the pairs, in the order of the features: E1-R1, E1-R2, ..."""
        return tuple(f"{one}-{other}" for one in self.emitter_names for other in self.receiver_names)

    def to_json(self) -> dict[str, Any]:
        """The header as plain data, which `header_of_json` reads."""
        curve = self.force_curve
        return {
            "format": self.format,
            "version": self.version,
            "kind": self.kind,
            "design_digest": self.design_digest,
            "emitter_names": list(self.emitter_names),
            "receiver_names": list(self.receiver_names),
            "untouched_counts": [float(value) for value in self.untouched_counts],
            "trained_on": dict(self.trained_on),
            "settings": dict(self.settings),
            "created_with": dict(self.created_with),
            "force_curve": None
            if curve is None
            else {"depth_mm": list(curve.depth_mm), "force_n": list(curve.force_n)}
            | ({"relative_sigma": curve.relative_sigma} if curve.relative_sigma else {}),
        }


def header_of_json(document: Any) -> ModelHeader:
    """A header from plain data.

    Raises
    ------
    InputError : an entry is missing or wrong, or the version differs; the message names the entry.
    """
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError("is no optopad model; `optopad train` makes one")
    if document.get("version") != VERSION:
        raise InputError(
            f"has version {document.get('version')!r} of the model format, this optopad reads {VERSION}; "
            "train the model again, or use the optopad that made it"
        )
    emitters, receivers = _names(document, "emitter_names"), _names(document, "receiver_names")
    untouched = _numbers(document.get("untouched_counts"), "untouched_counts")
    if len(untouched) != len(emitters) * len(receivers):
        raise InputError(
            f"untouched_counts: has {len(untouched)} values for {len(emitters)} x {len(receivers)} pairs"
        )
    digest = document.get("design_digest")
    return ModelHeader(
        kind=_text(document.get("kind"), "kind"),
        design_digest=None if digest is None else _text(digest, "design_digest"),
        emitter_names=emitters,
        receiver_names=receivers,
        untouched_counts=np.array(untouched),
        trained_on=_table(document, "trained_on"),
        settings=_table(document, "settings"),
        created_with=_table(document, "created_with"),
        force_curve=_force_curve(document.get("force_curve")),
    )


def require_design(header: ModelHeader, design_digest: str) -> None:
    """Check that a model was trained for this design; a model without a digest is accepted.

    Raises
    ------
    InputError : the designs differ; the message has both digests and says what to do.
    """
    if header.design_digest is not None and header.design_digest != design_digest:
        raise InputError(
            f"model: is of design {header.design_digest[:8]}, the sensor's is {design_digest[:8]}; "
            "their signals differ: train a model on recordings of this design"
        )


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{name}: {value!r} is no name")
    return value


def _names(document: Mapping[str, Any], name: str) -> tuple[str, ...]:
    values = document.get(name)
    if not isinstance(values, list) or not values:
        raise InputError(f"{name}: {values!r} is no list of names")
    return tuple(_text(value, name) for value in values)


def _table(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    value = document.get(name, {})
    if not isinstance(value, dict):
        raise InputError(f"{name}: {value!r} is no table")
    return value


def _numbers(values: Any, name: str) -> tuple[float, ...]:
    if not isinstance(values, list) or not all(
        isinstance(value, int | float) and abs(value) <= LARGEST_NUMBER for value in values
    ):
        raise InputError(f"{name}: is no list of finite numbers")
    return tuple(float(value) for value in values)


def _force_curve(value: Any) -> ForceCurve | None:
    if value is None:
        return None
    if not isinstance(value, dict):
        raise InputError(f"force_curve: {value!r} is no table")
    depth_mm = _numbers(value.get("depth_mm"), "force_curve.depth_mm")
    force_n = _numbers(value.get("force_n"), "force_curve.force_n")
    if len(depth_mm) != len(force_n) or len(depth_mm) < 2 or sorted(set(depth_mm)) != list(depth_mm):
        raise InputError("force_curve: needs two depths or more, rising, and a force for each")
    (sigma,) = _numbers([value.get("relative_sigma", 0.0)], "force_curve.relative_sigma")
    return ForceCurve(depth_mm=depth_mm, force_n=force_n, relative_sigma=sigma)

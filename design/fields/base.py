"""Base class of every specification model, field types that several models share, and dotted paths.

A dotted path names a field of a design, such as `layout.0.count`; list items are addressed by their index. The module
lists dotted paths, sets their values, and suggests known paths that are similar to an unknown one.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from functools import cache
from types import NoneType
from typing import Annotated, Any, ClassVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from optopad.design.errors import DesignError
from optopad.design.files import name_fault

# names of quantities on data sheets that a user may write as a field, and the fields that hold them
_COMMAND = "`optopad part new` writes the entry"
_LIGHT = (
    f"the field is radiant_power_mw of the part's entry; {_COMMAND} from mcd or mW/sr and the viewing angle"
)
_ANGLE = (
    f"the field is half_angle_deg of the part's entry, half of a viewing angle; {_COMMAND} from a data sheet"
)
_AREA = (
    f"the fields are active_width_mm and active_height_mm of the part's entry; {_COMMAND} from a data sheet"
)
_FIELDS = {
    _LIGHT: "intensity luminous_intensity radiant_intensity mcd luminous_flux lumen lumens",
    _ANGLE: "viewing_angle view_angle beam_angle full_angle half_angle angle_of_half_intensity",
    _AREA: "sensitive_area active_area radiant_sensitive_area chip_area die_area",
    f"the field is wavelength_nm of the part's entry; {_COMMAND} from a data sheet": (
        "wavelength peak_wavelength dominant_wavelength"
    ),
    f"the field is max_current_ma of the part's entry; {_COMMAND} from a data sheet": (
        "forward_current test_current rated_current"
    ),
    f"the fields are responsivity_a_per_w and responsivity_wavelength_nm of the part's entry; {_COMMAND} from a data "
    "sheet": "responsivity sensitivity spectral_sensitivity photosensitivity",
    f"the fields are the sizes of body and leads in the part's entry; {_COMMAND} from the name of a package": (
        "package"
    ),
}
_NAMES = {name: said for said, names in _FIELDS.items() for name in names.split()}
_UNIT = re.compile(r"_(u?m?cd|lm|m?w|m?w_(?:per_)?sr|deg|degrees|nm|ma|a|mm2?|a_(?:per_)?w|typ|min|max)$")


def sheet_name_hint(path: str) -> str:
    """Remedy for a field that has the name of a quantity on a data sheet; empty for other names.

    Parameters
    ----------
    path : dotted path of the unknown field; its last part may end with a unit, as `luminous_intensity_mcd`
    """
    if path.startswith("indenter."):  # a cone has a half angle, too
        return ""
    name = path.rpartition(".")[2].lower().replace("-", "_")
    while name not in _NAMES and _UNIT.search(name):
        name = _UNIT.sub("", name)
    return _NAMES.get(name, "")


@cache
def known_paths(model: type[BaseModel], prefix: str = "") -> tuple[str, ...]:
    """Dotted paths of all fields of a model and of the models nested in it."""
    found: list[str] = []
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        options = get_args(field.annotation)
        for inner in options if NoneType in options else (field.annotation,):
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                found += known_paths(inner, f"{path}.")
        found.append(path)
    return tuple(found)


def known_values(model: type[BaseModel]) -> tuple[str, ...]:
    """Dotted paths of the fields of a model that hold a value themselves and no further fields."""
    known = known_paths(model)
    return tuple(path for path in known if not any(other.startswith(f"{path}.") for other in known))


def get_at(document: Any, path: str) -> Any:
    """Value at a dotted path in nested dicts and lists; KeyError, IndexError or ValueError if there is none."""
    for key in path.split("."):
        document = document[int(key)] if isinstance(document, list) else document[key]
    return document


def is_value(document: Any, path: str) -> bool:
    """Whether a dotted path leads to a single value that is not None, and not to a table or a list."""
    try:
        found = get_at(document, path)
    except (KeyError, IndexError, ValueError, TypeError):
        return False
    return found is not None and not isinstance(found, dict | list)


def set_at(document: dict[str, Any], path: str, value: Any, *, known: tuple[str, ...]) -> None:
    """Set the value at a dotted path such as ``layout.0.count``, in place.

    Raises
    ------
    DesignError : the path does not exist; the message suggests similar paths from `known`.
    """
    *parents, last = path.split(".")
    target: Any = document
    try:
        for key in parents:
            target = target[int(key)] if isinstance(target, list) else _step_into(target, key, path, known)
        if isinstance(target, list):
            target[int(last)] = value
        elif path in known or last in target or _free_keys(path):
            target[last] = value
        else:
            raise KeyError(last)
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        raise unknown_path(path, known) from None


def leaves(document: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and value of each item in nested dicts and lists that is not itself a dict or list."""
    if isinstance(document, dict | list):
        items = document.items() if isinstance(document, dict) else enumerate(document)
        for key, value in items:
            yield from leaves(value, f"{path}.{key}" if path else str(key))
    else:
        yield path, document


def nearest(name: str, known: tuple[str, ...]) -> list[str]:
    """Up to three known names that are most similar to a misspelt name, the most similar first."""
    return difflib.get_close_matches(name, known, n=3, cutoff=0.5)


def unknown_path(path: str, known: tuple[str, ...]) -> DesignError:
    """Make the error for a path that does not exist in a design; the message suggests similar known paths."""
    if hint := sheet_name_hint(path):
        return DesignError(f"{path}: no such field in a design; {hint}")
    near = nearest(path, known)
    if not near:
        leaf = path.rsplit(".", 1)[-1]
        near = [name for name in known if name.rsplit(".", 1)[-1] == leaf][:3]
    hint = f"did you mean {', '.join(near)}?" if near else "`optopad schema` lists the fields"
    return DesignError(f"{path}: no such field in a design; {hint}")


def _step_into(target: dict[str, Any], key: str, path: str, known: tuple[str, ...]) -> Any:
    if target.get(key) is None and (path in known or path.startswith("part_measurements.")):
        target[key] = {}  # create an optional table, or the first measurement of a part
    return target[key]


def _free_keys(path: str) -> bool:
    """Whether a path's last key may be new: in the measurements of a part, or in a layout pattern."""
    return path.startswith(("part_measurements.", "layout.")) and path.count(".") == 2


NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,62}$"
"""Pattern of the names of designs, protocols and searches, which become file and folder names."""


def _usable(name: str) -> str:
    if fault := name_fault(name):
        raise ValueError(f"{fault}, and files are named after it")
    return name


FileName = Annotated[str, Field(pattern=NAME_PATTERN), AfterValidator(_usable)]
"""Name that becomes part of file names; names that Windows reserves for devices are refused."""

IDENTIFIER_PATTERN = r"^[a-z0-9][a-z0-9-]{0,62}$"
PartId = Annotated[str, Field(pattern=IDENTIFIER_PATTERN)]
"""Identifier of a catalogue entry: lower-case letters, digits and dashes."""


class Model(BaseModel):
    """Frozen base class of specification models; it refuses unknown keys, NaN and infinity."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True, strict=False
    )

    unsaid: ClassVar[tuple[str, ...]] = ()
    """Fields that a dump omits if they have their default value, so designs older than the field keep their digest."""

    @model_serializer(mode="wrap")
    def _as_said(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        document = plain(self)
        for name in self.unsaid:
            usual = type(self).model_fields[name].get_default(call_default_factory=True)
            if name in document and document[name] == usual:
                del document[name]
        return self._outlined(document)

    def _outlined(self, document: dict[str, Any]) -> dict[str, Any]:
        """Hook for subclasses: final form of a dump; for example, a disc has a diameter and no length and width."""
        return document

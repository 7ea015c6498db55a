"""Which messages of the page are taken: known kinds, with every field of its type. viser itself checks none.

A message that viser or a callback cannot use would end in a traceback on the terminal, and some kinds (uploads, forms)
would be kept without a bound. The types are those of viser's own messages.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields as fields_of
from typing import Any

import msgspec
from viser import _messages as kinds

KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        kinds.CommandTriggerMessage,
        kinds.GetRenderResponseMessage,
        kinds.GuiUpdateMessage,
        kinds.SceneNodeClickMessage,
        kinds.SceneNodeDragMessage,
        kinds.ScenePointerMessage,
        kinds.ViewerCameraMessage,
    )
}
"""What the studio's page sends: hotkeys, exported pictures, fields and buttons, clicks, drags, its camera."""
LARGEST_PICTURE_B, LARGEST_B = 16 * 2**20, 64 * 2**10
"""The largest exported picture, and the largest message of any other kind [bytes]."""
LARGEST_NUMBER = 1e9
"""No coordinate [mm], angle or size [px] is larger; squares of it stay finite."""


def fault_of(raw: str | bytes, inputs: Mapping[str, Any]) -> str | None:
    """Why a message is refused, in one line; None: it is taken.

    Parameters
    ----------
    raw : as it came
    inputs : viser's handles of the fields and buttons, by uuid
    """
    if isinstance(raw, str):
        return "text, where a message is bytes (MessagePack)"
    try:
        found = msgspec.msgpack.decode(raw)
    except (msgspec.MsgspecError, ValueError, RecursionError) as err:
        return f"{len(raw)} bytes that are no MessagePack: {err}"
    name = found.pop("type", None) if isinstance(found, dict) else None
    if not isinstance(name, str) or name not in KINDS:
        return f"type {name!r:.60} is not one of {', '.join(KINDS)}"
    if len(raw) > LARGEST_B and name != "GetRenderResponseMessage":
        return f"{name}: {len(raw)} bytes, where at most {LARGEST_B} are taken"
    fault = _fault_of_fields(name, found) or _fault_of_use(name, found, inputs)
    return None if fault is None else f"{name}: {fault}"


def _fault_of_fields(name: str, found: dict[str, Any]) -> str | None:
    """A field that is missing, unknown or of another type, or a number that no page has."""
    unknown = [str(key) for key in found.keys() - {field.name for field in fields_of(KINDS[name])}]
    if unknown:
        return f"unknown field {unknown[0]!r:.60}"
    try:
        msgspec.convert(found, KINDS[name])
    except msgspec.ValidationError as err:
        return str(err)
    wrong = [number for number in _numbers(found) if not abs(number) <= LARGEST_NUMBER]
    return f"{wrong[0]} is no number from {-LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}" if wrong else None


def _fault_of_use(name: str, found: dict[str, Any], inputs: Mapping[str, Any]) -> str | None:
    """What the types alone do not say of a click and of a field."""
    if name == "ScenePointerMessage":
        is_click = found["event_type"] == "click" and len(found["screen_pos"]) == 1
        has_ray = found["ray_origin"] is not None and found["ray_direction"] is not None
        return None if is_click and has_ray else "no click with one position and a ray"
    if name != "GuiUpdateMessage":
        return None
    if found["updates"].keys() != {"value"}:
        return f"updates {sorted(found['updates'])!s:.60}, where a page changes a value alone"
    handle, value = inputs.get(found["uuid"]), found["updates"]["value"]
    if handle is None or _fits(value, handle.value, getattr(handle, "options", None)):
        return None  # viser passes over a field that is gone
    return f"value {value!r:.60}, where the field has {handle.value!r:.60}"


def _fits(value: Any, now: Any, options: tuple[str, ...] | None) -> bool:
    """Whether a field that has a value can take another one."""
    if options is not None:
        return value in options
    if isinstance(now, int | float) and not isinstance(now, bool):
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(now, bool | str) and type(value) is type(now)


def _numbers(value: Any) -> Iterator[float]:
    """Every number in a message; NaN counts as one."""
    if isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _numbers(one)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield math.inf if isinstance(value, int) and abs(value) > LARGEST_NUMBER else value

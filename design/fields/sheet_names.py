"""Names of quantities on data sheets that a user may write as a field, and the fields that hold them.

A design and its catalogue state radiant power and half angles. Data sheets state intensities and viewing angles, which
the command `optopad part new` converts.
"""

from __future__ import annotations

import re

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

"""Draw the figure of docs/how-to/calibrate.md: measured force under a press, the fit, and the fit without relaxation.

python -m tests.sims.learning.force_picture     writes docs/images/force-fit.svg
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.load_protocol import StandardLinearSolid, viscoelastic_load_n
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.force_fit import fit_force
from optopad.sims.learning.press_force import TipPath
from optopad.sims.plots.style import plain_style
from tests.sims.learning.test_force_fit import PAD, TARE_N, pressed

PICTURE = Path(__file__).parents[3] / "docs" / "images" / "force-fit.svg"
SHOWN_S = 6.0


def main() -> None:
    solid = StandardLinearSolid(relaxed_share=0.15, time_constant_s=1.0)
    time_s, press_mm, force_n = pressed(10, 0.7, solid, noise_n=0.02)
    found = fit_force(PAD, time_s, TipPath(time_s=time_s, press_mm=press_mm), force_n)
    assert found.time_constant_s is not None
    part = time_s < SHOWN_S
    at = press_mm[0, :2]
    solved = solved_press(contact_of(PAD), 4.6, at_mm=(float(at[0]), float(at[1])))
    depth = np.maximum(press_mm[part, 2] + found.offset_mm, 0.0)
    slow = found.modulus_mpa / found.design_mpa * np.array([solved.force_n(float(one)) for one in depth])
    fitted = StandardLinearSolid(relaxed_share=found.relaxed_share, time_constant_s=found.time_constant_s)
    with plain_style():
        figure, ax = plt.subplots(figsize=(6.5, 2.8), layout="constrained")
        ax.plot(
            time_s[part], force_n[part] - TARE_N, ".", color="0.6", markersize=3, label="load cell, less tare"
        )
        ax.plot(time_s[part], np.maximum(viscoelastic_load_n(time_s[part], slow, fitted), 0.0), label="fit")
        ax.plot(time_s[part], slow, "--", label="the same modulus without relaxation")
        ax.set(xlabel="time [s]", ylabel="force [N]")
        ax.legend(frameon=False)
        figure.savefig(PICTURE, format="svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()

"""A map of a design's light over location and depth, traced on a grid and interpolated; and the design's force curve.

    places   a grid that reaches a little beyond the workspace, 1 mm apart at most. Nodes outside the workspace's round
             ends are mirrored at its border, f(outside) = 2 f(border) - f(inside), so that the spline is smooth there
    depths   equal steps of √depth, from 0 (the untouched pad) to the deepest press
    between  a tensor cubic spline of √(light / untouched light), pair by pair (`inference.signal_map`)

The root of the ratio was chosen after a comparison on the paper's pad, at 400 random presses that were traced more
finely and with another seed. A spline of the ratio itself has the same error down to 3.5 mm and a quarter more beyond;
a spline of its logarithm has half more (docs/validation/calibration.md has the figures). A pitch of 2 mm has four times
the error.

Symmetric locations are traced only once (`optopad.sims.optics.scene.symmetry`): on a pad with four equal sides, that
leaves a quarter of them. `measured_error` compares the map with presses at random locations and depths, traced with
another seed. It includes the interpolation and the numerical errors of both traces.

The force curve is the contact model's force for a press in the middle of the pad. Left out: presses near walls, which
raise the force by up to a tenth at 1 mm (docs/understand/model.md); the uncertainty of the modulus; viscosity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.rules.shape import NEAREST_WALL
from optopad.design.shape.cavity import cavity_of
from optopad.design.shape.outline import Outline
from optopad.design.spec import SensorDesign
from optopad.sims.contact.force_curve import force_curve
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.inference.header import ForceCurve
from optopad.sims.learning.inference.signal_map import TensorSpline, fitted_spline
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.tracing import trace
from optopad.sims.press import COARSE_STEP_MM, depth_schedule_mm


def load_curve(design: SensorDesign) -> ForceCurve:
    """Force against depth of a press in the middle of the pad, down to the design's deepest press.

    Raises
    ------
    ModelScopeError : the contact model does not cover the deepest press.
    """
    deepest = design.operating.max_depth_mm
    found = force_curve(solved_press(contact_of(design), deepest), depth_schedule_mm(deepest, COARSE_STEP_MM))
    return ForceCurve(
        depth_mm=tuple(float(depth) for depth in found.depth_mm),
        force_n=tuple(float(force) for force in found.force_n),
    )


PITCH_MM = 1.0
QUICK_PITCH_MM = 1.5
DEPTH_NODES = 11
QUICK_DEPTH_NODES = 10
"""Number of depths in the grid of a quick map, including depth 0; a full map has `DEPTH_NODES`."""
MARGIN_MM = 1.0
"""Largest distance by which a map reaches beyond the workspace [mm], so that its border is inside a cell."""
BEYOND_MM = 0.1
"""Distance by which a map reaches beyond the deepest press, where the contact model covers it [mm]."""
ERROR_PRESSES = 60
ERROR_SEED_GAP = 15_485_863
"""Number added to the seed for the presses at which the error is measured, and for their light."""
FAINTEST = 1e-3
"""Least untouched light in a ratio, divided by the median over pairs [-]; a fainter pair would only show noise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalMap:
    """Light of every pair on a grid of locations and depths.

    Attributes
    ----------
    x_mm : (nx,), y_mm : (ny,), root_depth : (ns,) nodes of x, y and √depth at equal steps [mm, mm, √mm]; the first
        depth is 0
    flux : (nx, ny, ns, emitter, receiver) received share of the emitted power [-]
    workspace : outline of the locations of the press axis for which the map is made
    digest, accuracy, seed : digest of the design, and accuracy setting and random seed of the light model
    error : (pair,) root mean square error of the ratio of light to untouched light at random presses [-]; None if not
        measured
    checked : these random presses and their light; None if the error was not measured
    """

    x_mm: FloatArray
    y_mm: FloatArray
    root_depth: FloatArray
    flux: FloatArray
    workspace: Outline
    digest: str
    accuracy: str
    seed: int
    error: FloatArray | None = None
    checked: MapError | None = None

    @property
    def untouched(self) -> FloatArray:
        """Light (pair,) of the untouched pad [-], raised to `FAINTEST` times the median over pairs where it is less."""
        flat = self.flux[0, 0, 0].ravel()
        return np.asarray(np.maximum(flat, FAINTEST * np.median(flat)))

    @property
    def is_bright(self) -> BoolArray:
        """Whether the untouched light of each pair (pair,) is not raised."""
        return np.asarray(self.flux[0, 0, 0].ravel() >= self.untouched)

    @property
    def ratio_root(self) -> TensorSpline:
        """√(light / untouched light) of every pair as a spline."""
        values = self.flux.reshape(*self.flux.shape[:3], -1) / self.untouched
        nodes = (self.x_mm, self.y_mm, self.root_depth)
        return fitted_spline(
            np.sqrt(np.maximum(values, 0.0)),
            np.array([axis[0] for axis in nodes]),
            np.array([axis[1] - axis[0] for axis in nodes]),
        )

    def at(self, press_mm: FloatArray) -> FloatArray:
        """Light (n, emitter, receiver) at presses (n, 3) as a share of the emitted power [-]."""
        found = self.ratio_root.values(press_mm) ** 2 * self.untouched
        return np.asarray(found.reshape(-1, *self.flux.shape[3:]))


def map_nodes(
    design: SensorDesign, pitch_mm: float, depth_nodes: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes of a map's grid along x [mm], y [mm] and √depth [√mm].

    Raises
    ------
    InputError : the pitch or the number of depths is out of range.
    """
    if not 0.2 <= pitch_mm <= 5.0 or not 5 <= depth_nodes <= 60:
        raise InputError(
            f"map: pitch {pitch_mm:g} mm and {depth_nodes} depths; needs 0.2 to 5 mm and 5 to 60 depths"
        )
    space = cavity_of(design).workspace
    beside = design.operating.workspace_margin_mm
    to_scope = beside - (NEAREST_WALL - 1.0) * design.indenter.tip_radius_mm
    margin = max(0.0, min(MARGIN_MM, 0.5 * beside, to_scope))
    deepest = min(design.operating.max_depth_mm + BEYOND_MM, contact_of(design).depth_limit_mm)
    return (
        _line(space.x0_mm - margin, space.x1_mm + margin, pitch_mm),
        _line(space.y0_mm - margin, space.y1_mm + margin, pitch_mm),
        np.linspace(0.0, np.sqrt(deepest), depth_nodes),
    )


def _line(low: float, high: float, pitch: float) -> FloatArray:
    return np.linspace(low, high, max(int(np.ceil((high - low) / pitch - 1e-9)) + 1, 5))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Nodes:
    """Traced locations of a map, and how the light at its nodes follows from the light there.

    Attributes
    ----------
    traced_mm : (place, 2) x, y of the traced locations [mm]
    border, inner : (node,) indices of the two traced locations that give a node's light as 2 border - inner. They are
        equal if the node itself was traced
    """

    traced_mm: FloatArray
    border: IntArray
    inner: IntArray

    def filled(self, at_places: FloatArray, untouched: FloatArray) -> FloatArray:
        """Light at the nodes (node, ...), from the light at the traced locations (place, ...).

        For nodes outside the workspace, √(light / untouched light) is mirrored at its border.
        """
        root = np.sqrt(at_places / np.where(untouched > 0.0, untouched, 1.0))
        mirrored = np.maximum(2.0 * root[self.border] - root[self.inner], 0.0) ** 2 * untouched
        is_own = (self.border == self.inner).reshape(-1, *(1,) * (at_places.ndim - 1))
        return np.where(is_own, at_places[self.border], mirrored)


def _nodes_of(space: Outline, x_mm: FloatArray, y_mm: FloatArray) -> _Nodes:
    """The nodes of a grid, ordered by x first; each node outside the workspace uses two traced locations."""
    nodes = np.stack([axis.ravel() for axis in np.meshgrid(x_mm, y_mm, indexing="ij")], axis=1)
    reach = space.in_box((x_mm[0], y_mm[0], x_mm[-1], y_mm[-1]))
    is_own = reach.contains(*nodes.T)
    own, outside = np.flatnonzero(is_own), np.flatnonzero(~is_own)
    ends = np.array([reach.clamped(*node) for node in nodes[outside].tolist()]).reshape(-1, 2)
    border, inner = np.zeros(len(nodes), dtype=np.int64), np.zeros(len(nodes), dtype=np.int64)
    border[own] = inner[own] = np.arange(len(own))
    border[outside] = len(own) + np.arange(len(outside))
    inner[outside] = border[outside] + len(outside)
    places = np.concatenate([nodes[own], ends, 2.0 * ends - nodes[outside]])
    return _Nodes(traced_mm=places, border=border, inner=inner)


def traced_map(
    design: SensorDesign,
    *,
    pitch_mm: float = PITCH_MM,
    depth_nodes: int = DEPTH_NODES,
    accuracy: str | Accuracy = "draft",
    seed: int = 0,
    on_step: OnStep | None = None,
) -> SignalMap:
    """Trace the light of a design on a grid of locations and depths.

    Parameters
    ----------
    pitch_mm : largest distance between neighbouring locations [mm]
    depth_nodes : number of depths, including depth 0 (the untouched pad)
    accuracy, seed : accuracy setting and random seed of the light model
    on_step : called with ``map`` and the fraction done (0 to 1)

    Raises
    ------
    InputError : the pitch or the number of depths is out of range.
    ModelScopeError : the contact or light model does not cover a press.
    """
    x_mm, y_mm, root = map_nodes(design, pitch_mm, depth_nodes)
    depths = root[1:] ** 2
    nodes = _nodes_of(cavity_of(design).workspace, x_mm, y_mm)
    presses = np.column_stack(
        [np.repeat(nodes.traced_mm, len(depths), axis=0), np.tile(depths, len(nodes.traced_mm))]
    )
    tell = on_step or (lambda _stage, _share: None)
    light = trace(
        Draft.of(design),
        np.concatenate([[[x_mm.mean(), y_mm.mean(), 0.0]], presses]),
        accuracy=accuracy,
        seed=seed,
        on_step=lambda done, total: tell("map", done / total),
    )
    parts = light.flux.shape[1:]
    at_places = light.flux[1:].reshape(len(nodes.traced_mm), len(depths), *parts)
    pressed = nodes.filled(at_places, light.flux[0]).reshape(len(x_mm), len(y_mm), len(depths), *parts)
    flat = np.broadcast_to(light.flux[0], (len(x_mm), len(y_mm), 1, *parts))
    space = cavity_of(design).workspace
    return SignalMap(
        x_mm=x_mm,
        y_mm=y_mm,
        root_depth=root,
        flux=np.concatenate([flat, pressed], axis=2),
        workspace=space,
        digest=design.digest,
        accuracy=accuracy if isinstance(accuracy, str) else "own settings",
        seed=seed,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MapError:
    """Light of a map compared with separately traced light, at random presses.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth of the presses [mm]
    found, truth : (n, emitter, receiver) light from the map and from the separate trace, as a share of the emitted
        power [-]
    """

    press_mm: FloatArray
    found: FloatArray
    truth: FloatArray

    def of_ratio(self, untouched: FloatArray) -> FloatArray:
        """Root mean square error (pair,) of the map's light, divided by the untouched light (pair,) [-]."""
        off = (self.found - self.truth).reshape(len(self.press_mm), -1) / untouched
        return np.asarray(np.sqrt((off**2).mean(axis=0)))


def measured_error(
    design: SensorDesign,
    found: SignalMap,
    *,
    presses: int = ERROR_PRESSES,
    accuracy: str | Accuracy = "draft",
    on_step: OnStep | None = None,
) -> MapError:
    """Compare a map with light of another seed, at presses of random location and depth (uniform in √depth)."""
    seed = found.seed + ERROR_SEED_GAP
    chance = np.random.default_rng(seed).uniform(size=(presses, 3))
    press_mm = np.column_stack(
        [found.workspace.spread(chance[:, :2]), (chance[:, 2] * found.root_depth[-1]) ** 2]
    )
    tell = on_step or (lambda _stage, _share: None)
    light = trace(
        Draft.of(design),
        press_mm,
        accuracy=accuracy,
        seed=seed,
        on_step=lambda done, total: tell("map error", done / total),
    )
    return MapError(press_mm=press_mm, found=found.at(press_mm), truth=light.flux)

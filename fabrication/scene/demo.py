"""The demo scene: a parallel gripper with a pad on each finger picks a cylinder, a box and a ball from a table.

            |   carriage: slides along x and z
        ____|____
       |_palm____|        both fingers slide along y, coupled as in a parallel gripper
       |         |
       |[left   right]    pads face each other; their x is the world's x
             o            objects on posts, since the molds are taller than the objects
        _____|_____       table, z = 0

Sizes follow the pad: objects fit between the rims of its mold. A closed finger pushes with the force of a ball at
`GRIP_MM`. The model's number `demo_script` has the script in rows of time [s], x, z [m] of the carriage and closing
(0 or 1); `drive` sets the actuators from it, so the file alone is enough:

    model = mujoco.MjModel.from_xml_path("demo.xml")
    tuned(model, "left"), tuned(model, "right")
    data = mujoco.MjData(model)
    while data.time < duration_s(model):
        drive(model, data)
        mujoco.mj_step(model, data)

Friction in MuJoCo lets a held object creep: a cylinder of 5.5 g between pads of the preset gripper-teensy sinks by
1.3 mm/s with MuJoCo's default pyramidal cone, by 0.44 mm/s with an elliptic one, and by 0.004 mm/s with `impratio` of
100 as here. A robot's own model needs both options, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.contact_fit import contact_fit
from optopad.fabrication.scene.mjcf import M_PER_MM, pad_spec

STEP_S = 0.002
OBJECTS = ("cylinder", "box", "ball")
GRIP_MM = 1.0
"""Depth of a ball whose force closes the fingers [mm]."""
OPEN_MM, LIFT_MM, CLEAR_MM, FINGER_MM = 8.0, 60.0, 10.0, 6.0
"""Gap of an open finger to the largest object, height of a lift, clearance of molds, thickness of fingers [mm]."""
HALF, POST, TALL = 0.32, 0.12, 0.3
"""Half size of objects and of their posts across the fingers, and half height of the cylinder, over the pad's width."""
DENSITY = 2700.0
"""Of the objects, aluminium [kg/m3]."""
PHASES = {
    "move": (0.8, 0.0, 0.0),
    "down": (0.6, 1.0, 0.0),
    "close": (0.5, 1.0, 1.0),
    "lift": (0.7, 0.0, 1.0),
    "hold": (0.4, 0.0, 1.0),
    "back": (0.7, 1.0, 1.0),
    "open": (0.4, 1.0, 0.0),
    "up": (0.6, 0.0, 0.0),
}
"""Phases of the script for each object: time [s], whether the gripper is down and whether it is closed at their end."""
GRIP_N_PER_M = 10_000.0
"""Stiffness of a finger's servo [N/m]."""
SCRIPT = "demo_script"
IMPRATIO = 100.0
TABLE_RGBA, POST_RGBA, STEEL_RGBA = (0.78, 0.72, 0.62, 1.0), (0.55, 0.57, 0.60, 1.0), (0.56, 0.60, 0.66, 1.0)
OBJECT_RGBA = {
    "cylinder": (0.85, 0.40, 0.15, 1.0),
    "box": (0.20, 0.50, 0.80, 1.0),
    "ball": (0.30, 0.65, 0.30, 1.0),
}
GEOM = mujoco.mjtGeom


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Sizes of the scene [m].

    Attributes
    ----------
    half : half size of the objects across the fingers
    heights : half height of each object
    pad : outer half sizes of a mold along x and y of the cavity, and its height up to the top's highest point
    grip_z : height of the pads' middle when they grip
    pitch : distance between objects
    width : the smaller inner size of the pad
    """

    half: float
    heights: dict[str, float]
    pad: tuple[float, float, float]
    grip_z: float
    pitch: float
    width: float


def sizes_of(design: SensorDesign) -> Sizes:
    """Sizes of the scene of a design's pad."""
    draft = Draft.of(design)
    plan, outline = draft.plan, draft.outline
    width = min(plan.length_mm, plan.width_mm) * M_PER_MM
    pad = (
        outline.outer_length_mm / 2 * M_PER_MM,
        outline.outer_width_mm / 2 * M_PER_MM,
        (plan.clear_mm - outline.bottom_mm) * M_PER_MM,
    )
    half = HALF * width
    return Sizes(
        half=half,
        heights={"cylinder": TALL * width, "box": half, "ball": half},
        pad=pad,
        grip_z=pad[1] + CLEAR_MM * M_PER_MM,
        pitch=2.0 * pad[0] + 2.0 * CLEAR_MM * M_PER_MM,
        width=width,
    )


def demo_spec(design: SensorDesign) -> mujoco.MjSpec:
    """The demo scene of a design's pad; errors are those of `mjcf.pad_spec`."""
    size, spec = sizes_of(design), gripper_spec(design, grip_force_n(design))
    spec.modelname = f"{design.name} demo"
    for number, name in enumerate(OBJECTS):
        post = POST * size.width
        add_object(
            spec, name, ((number - 1) * size.pitch, 0.0, size.grip_z), size.half, size.heights[name], post
        )
    spec.add_numeric(name=SCRIPT, data=[float(one) for one in _script(size).ravel()])
    return spec


def grip_force_n(design: SensorDesign) -> float:
    """Force of a ball of the tip's radius at `GRIP_MM` or, if less, at the deepest press of the fit [N]."""
    fit = contact_fit(design)
    return float(np.interp(GRIP_MM, fit.depth_mm, fit.force_n))


def gripper_spec(design: SensorDesign, force_n: float) -> mujoco.MjSpec:
    """The gripper with two pads over a table, without objects; `force_n` is the largest force of a finger [N]."""
    size, spec = sizes_of(design), mujoco.MjSpec()
    spec.option.timestep = STEP_S
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = IMPRATIO
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    _surroundings(spec, size)
    _add_gripper(spec, design, size, force_n)
    return spec


def _surroundings(spec: mujoco.MjSpec, size: Sizes) -> None:
    """Light, sky, cameras and table."""
    reach = size.pitch + size.pad[0]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.map.znear, spec.visual.map.zfar = 0.02, 60.0
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.45] * 3
    spec.stat.extent, spec.stat.center = 3.0 * reach, [0.0, 0.0, size.grip_z]
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1, sky.rgb2, sky.width, sky.height = [0.95, 0.96, 0.98], [0.70, 0.75, 0.82], 64, 384
    world = spec.worldbody
    world.add_light(pos=[0.3 * reach, -3.0 * reach, 5.0 * reach], dir=[-0.05, 0.5, -0.85], diffuse=[0.5] * 3)
    world.add_geom(
        name="table",
        type=GEOM.mjGEOM_BOX,
        pos=[0, 0, -0.01],
        size=[1.6 * reach, reach, 0.01],
        rgba=TABLE_RGBA,
    )
    grip = np.array([0.0, 0.0, size.grip_z])
    middle = grip + np.array([0.0, 0.0, 0.7 * LIFT_MM * M_PER_MM])
    for name, at, way in (
        ("front", middle, (1.6, -3.6, 1.3)),
        ("side", middle, (4.0, -1.5, 0.9)),
        ("near", grip, (1.6, -0.35, 0.4)),
    ):
        world.add_camera(name=name, **_looking(at + reach * np.array(way), at), fovy=34)


def _looking(place: FloatArray, at: FloatArray) -> dict[str, list[float]]:
    """Position and orientation of a camera that looks at a point, with z up."""
    back = (place - at) / np.linalg.norm(place - at)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.stack([right, np.cross(back, right), back], axis=1).ravel())
    return {"pos": place.tolist(), "quat": quat.tolist()}


def add_object(
    spec: mujoco.MjSpec, name: str, place: tuple[float, float, float], half: float, tall: float, post: float
) -> None:
    """Add an object, and the post below it as a body ``<name>_post`` that touches nothing else.

    Parameters
    ----------
    name : one of `OBJECTS`
    place : its centre [m]
    half, tall : half sizes across the fingers and upward [m]; upward only of the cylinder
    post : half size of the post across the fingers [m]
    """
    x, y, z = place
    top = (z - (tall if name == "cylinder" else half)) / 2
    spec.worldbody.add_body(name=f"{name}_post", pos=[x, y, top]).add_geom(
        name=f"{name}_post", type=GEOM.mjGEOM_BOX, size=[0.8 * half, post, top], rgba=POST_RGBA, contype=2,
        conaffinity=2, priority=1, solref=[2.0 * STEP_S, 1.0],  # MuJoCo's usual contact gives way by 0.4 mm
    )  # fmt: skip
    body = spec.worldbody.add_body(name=name, pos=list(place))
    body.add_freejoint(name=f"{name}_free")
    shape, extent = {
        "cylinder": (GEOM.mjGEOM_CYLINDER, [half, tall, 0.0]),
        "box": (GEOM.mjGEOM_BOX, [half, half, half]),
        "ball": (GEOM.mjGEOM_SPHERE, [half, 0.0, 0.0]),
    }[name]
    body.add_geom(
        name=name, type=shape, size=extent, density=DENSITY, rgba=OBJECT_RGBA[name], condim=6, contype=3,
        conaffinity=3, friction=[0.8, 0.005, 0.001],
    )  # fmt: skip


def _add_gripper(spec: mujoco.MjSpec, design: SensorDesign, size: Sizes, force_n: float) -> None:
    lift, thick = LIFT_MM * M_PER_MM, FINGER_MM * M_PER_MM / 2
    opened = size.half + OPEN_MM * M_PER_MM
    across, tall, deep = size.pad
    carriage = spec.worldbody.add_body(name="carriage", pos=[0.0, 0.0, size.grip_z + lift], gravcomp=1.0)
    reach = 2.0 * size.pitch
    carriage.add_joint(
        name="carriage_x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], range=[-reach, reach]
    )
    carriage.add_joint(
        name="carriage_z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], range=[-2 * lift, lift]
    )
    palm = tall + 2.0 * CLEAR_MM * M_PER_MM
    half_palm = opened + deep + 3.0 * thick
    carriage.add_geom(
        name="palm", type=GEOM.mjGEOM_BOX, pos=[0, 0, palm + thick], size=[0.8 * across, half_palm, 2 * thick],
        mass=0.5, rgba=STEEL_RGBA,
    )  # fmt: skip
    carriage.add_geom(
        name="column", type=GEOM.mjGEOM_CYLINDER, pos=[0, 0, palm + 3 * thick + lift / 2],
        size=[2.5 * thick, lift / 2, 0], mass=0.2, rgba=STEEL_RGBA,
    )  # fmt: skip
    travel = OPEN_MM * M_PER_MM + 0.8 * size.half
    for name, side in (("left", -1.0), ("right", 1.0)):
        finger = carriage.add_body(name=f"{name}_finger", pos=[0.0, side * opened, 0.0], gravcomp=1.0)
        finger.add_joint(
            name=f"{name}_slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, -side, 0.0], range=[0.0, travel],
            damping=5.0,
        )  # fmt: skip
        finger.add_geom(
            name=f"{name}_beam", type=GEOM.mjGEOM_BOX, pos=[0.0, side * (deep + thick), (palm - tall) / 2],
            size=[0.8 * across, thick, (palm + tall) / 2], mass=0.08, rgba=STEEL_RGBA,
        )  # fmt: skip
        turn = side * math.pi / 4
        mount = finger.add_site(
            name=f"{name}_mount", pos=[0.0, side * deep, 0.0], quat=[math.cos(turn), math.sin(turn), 0.0, 0.0],
            size=[M_PER_MM] * 3, group=5,
        )  # fmt: skip
        spec.attach(pad_spec(design), prefix=f"{name}_", site=mount)
        _add_servo(
            spec, f"{name}_slide", stiffness=GRIP_N_PER_M, damping=60.0,
            range_=[0.0, travel + force_n / GRIP_N_PER_M], force=force_n,
        )  # fmt: skip
    _add_servo(spec, "carriage_x", stiffness=4000.0, damping=150.0, range_=[-reach, reach], force=200.0)
    _add_servo(spec, "carriage_z", stiffness=4000.0, damping=150.0, range_=[-2 * lift, lift], force=200.0)
    coupling = spec.add_equality(
        name="parallel",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1="left_slide",
        name2="right_slide",
    )
    coupling.data[:5] = [0.0, 1.0, 0.0, 0.0, 0.0]


def _add_servo(
    spec: mujoco.MjSpec, joint: str, *, stiffness: float, damping: float, range_: list[float], force: float
) -> None:
    """A position servo with a limited force [N/m, Ns/m, m, N]."""
    servo = spec.add_actuator(
        name=joint,
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrlrange=range_,
        forcerange=[-force, force],
    )
    servo.set_to_position(kp=stiffness, kv=damping)


def _script(size: Sizes) -> FloatArray:
    """Rows of time [s], x and z of the carriage [m], and closing."""
    rows, time = [[0.0, 0.0, 0.0, 0.0]], 0.0
    for number in range(len(OBJECTS)):
        for seconds, down, closed in PHASES.values():
            time += seconds
            rows.append([time, (number - 1) * size.pitch, -down * LIFT_MM * M_PER_MM, closed])
    return np.array(rows)


def script_of(model: mujoco.MjModel) -> FloatArray:
    """The script (n, 4) in a model: time [s], x and z of the carriage [m], closing from 0 to 1."""
    return np.array(model.numeric(SCRIPT).data).reshape(-1, 4)


def duration_s(model: mujoco.MjModel) -> float:
    """Time at which the script ends [s]."""
    return float(script_of(model)[-1, 0])


def drive(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set the actuators to the script at the data's time; motions start and end smoothly."""
    rows = script_of(model)
    k = min(int(np.searchsorted(rows[:, 0], data.time, side="right")), len(rows) - 1)
    share = min((data.time - rows[k - 1, 0]) / (rows[k, 0] - rows[k - 1, 0]), 1.0)
    x, z, closed = rows[k - 1, 1:] + share * share * (3.0 - 2.0 * share) * (rows[k, 1:] - rows[k - 1, 1:])
    data.actuator("carriage_x").ctrl = x
    data.actuator("carriage_z").ctrl = z
    for name in ("left_slide", "right_slide"):
        data.actuator(name).ctrl = closed * model.actuator(name).ctrlrange[1]


def held_at(model: mujoco.MjModel, name: str) -> float:
    """Middle of the time for which the script holds an object up [s]."""
    end = 1 + OBJECTS.index(name) * len(PHASES) + list(PHASES).index("hold")
    return float(script_of(model)[end - 1 : end + 1, 0].mean())

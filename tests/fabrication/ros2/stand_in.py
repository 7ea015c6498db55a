"""A stand-in for ROS 2: rclpy's lifecycle nodes and launch, as far as the sensor's package uses them, with the real
message types.

Types come from rosbags, so that every published message is serialised and read back as ROS does.
"""

from __future__ import annotations

import importlib.util
import sys
import time
import types
from dataclasses import field, make_dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import Nodetype

from optopad.fabrication.ros2 import definition, names

PACKAGE = Path(__file__).parents[3] / "fabrication" / "ros2" / "optopad_ros"
NODE = PACKAGE / "optopad_ros" / "sensor_node.py"
LAUNCH = PACKAGE / "launch" / "sensor.launch.py"
TAKEN = (
    *(
        "_allow_undeclared_parameters",
        "_callbacks",
        "_clients",
        "_clock",
        "_context",
        "_default_callback_group",
    ),
    *("_descriptors", "_guards", "_logger", "_logger_service", "_managed_entities", "_parameter_overrides"),
    *("_parameters", "_publishers", "_rate_group", "_services", "_state_machine", "_subscriptions"),
    *("_time_source", "_timers", "_type_description_service"),
)
"""Attributes of rclpy's own nodes, in Humble, Jazzy and Kilted; a node that sets one of them breaks itself."""


def store_of(version: str) -> Any:
    """The types of a ROS distribution and of optopad."""
    store = get_typestore(Stores[version])
    for name in names():
        store.register(get_types_from_msg(definition(name).partition("=" * 80)[0], name))
    return store


STORE = store_of("ROS2_HUMBLE")
_CLASSES: dict[str, type] = {}


def _default(kind: Any) -> Any:
    node, what = kind
    if node == Nodetype.BASE:
        name = what[0] if isinstance(what, tuple) else what
        return "" if name == "string" else False if name == "bool" else 0.0 if name.startswith("float") else 0
    if node == Nodetype.NAME:
        return class_of(what)()
    return []


def class_of(name: str) -> type:
    """A class with the fields of a message and defaults, as rclpy's generated classes have."""
    if name not in _CLASSES:
        _, entries = STORE.fielddefs[name]
        made = [
            (one, Any, field(default_factory=lambda kind=kind: _default(kind)))  # type: ignore[misc]
            for one, kind in entries
        ]
        _CLASSES[name] = make_dataclass(name.rpartition("/")[2], made, namespace={"msgtype": name})
    return _CLASSES[name]


def as_ros(message: Any) -> Any:
    """The message of rosbags with the content of a filled message object."""
    _, entries = STORE.fielddefs[message.msgtype]
    return STORE.types[message.msgtype](
        **{name: _value(kind, getattr(message, name)) for name, kind in entries}
    )


def _value(kind: Any, value: Any) -> Any:
    node, what = kind
    if node == Nodetype.BASE:
        return value[0] if isinstance(value, bytes) else value
    if node == Nodetype.NAME:
        return as_ros(value)
    inner, _ = what
    if inner[0] == Nodetype.NAME:
        return [as_ros(one) for one in value]
    name = inner[1][0] if isinstance(inner[1], tuple) else inner[1]
    return list(value) if name == "string" else np.array(value, dtype=name)


def cdr(message: Any) -> bytes:
    """A message in ROS 2's encoding; it is read back to see that nothing changes."""
    data = bytes(STORE.serialize_cdr(as_ros(message), message.msgtype))
    assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, message.msgtype), message.msgtype)) == data
    return data


class Publisher:
    """Keeps what it publishes, in order, with the time; a lifecycle publisher only while it is active."""

    def __init__(self, kind: type, topic: str, *, is_active: bool = True) -> None:
        self.kind, self.topic, self.is_active = kind, topic, is_active
        self.messages: list[tuple[float, Any]] = []

    def publish(self, message: Any) -> None:
        assert isinstance(message, self.kind)
        if self.is_active:
            self.messages.append((time.time(), message))


class Log:
    """Keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def info(self, text: str) -> None:
        self.lines.append(text)

    warning = error = fatal = info


class InvalidParameterTypeException(Exception):  # noqa: N818, the name in rclpy
    """A parameter without dynamic typing was given a value of another type than its default."""


class RosClock:
    """The time of this machine, or of a simulation once `simulated_s` is set."""

    def __init__(self) -> None:
        self.simulated_s: float | None = None

    @property
    def ros_time_is_active(self) -> bool:
        return self.simulated_s is not None

    def now(self) -> Any:
        whole = time.time_ns() if self.simulated_s is None else round(self.simulated_s * 1e9)
        message = class_of("builtin_interfaces/msg/Time")()
        message.sec, message.nanosec = divmod(whole, 10**9)
        return types.SimpleNamespace(nanoseconds=whole, to_msg=lambda: message)


class Future:
    """A result that is set once."""

    def __init__(self) -> None:
        self.result: Any = None

    def set_result(self, result: Any) -> None:
        self.result = result

    def done(self) -> bool:
        return self.result is not None


class LifecycleNode:
    """A node with its parameters, topics, services and log as attributes."""

    given: ClassVar[dict[str, Any]] = {}
    namespace: ClassVar[str] = "/"

    def __init__(self, name: str) -> None:
        self.name, self.log, self.clock = name, Log(), RosClock()
        self.context = types.SimpleNamespace(ok=lambda: True)
        self.parameters: dict[str, Any] = {}
        self.topics: dict[str, Publisher] = {}
        self.published: dict[str, Publisher] = {}
        self.offered: dict[str, Any] = {}
        self.timers: list[Any] = []

    def __setattr__(self, name: str, value: Any) -> None:
        assert name not in TAKEN, f"{name} is an attribute of rclpy's own nodes"
        super().__setattr__(name, value)

    def get_fully_qualified_name(self) -> str:
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def get_logger(self) -> Log:
        return self.log

    def get_clock(self) -> RosClock:
        return self.clock

    def declare_parameter(self, name: str, value: Any, descriptor: Any = None) -> None:
        found = self.given.get(name, value)
        if type(found) is not type(value) and not (descriptor and descriptor.dynamic_typing):
            raise InvalidParameterTypeException(f"{name}: {found!r}, expecting {type(value).__name__}")
        self.parameters[name] = found

    def get_parameter(self, name: str) -> Any:
        return types.SimpleNamespace(value=self.parameters[name])

    def create_publisher(self, kind: type, topic: str, _qos: Any) -> Publisher:
        return self._made(Publisher(kind, topic))

    def create_lifecycle_publisher(self, kind: type, topic: str, _qos: Any) -> Publisher:
        return self._made(Publisher(kind, topic, is_active=False))

    def _made(self, publisher: Publisher) -> Publisher:
        self.topics[publisher.topic] = self.published[publisher.topic] = publisher
        return publisher

    def create_service(self, kind: Any, name: str, call: Any) -> str:
        self.offered[name] = (kind, call)
        return name

    def create_timer(self, _period_s: float, call: Any, clock: str) -> Any:
        assert clock == "steady", "a timer by simulated time stops with it"
        self.timers.append(call)
        return call

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def destroy_service(self, service: str) -> None:
        del self.offered[service]

    def destroy_publisher(self, publisher: Publisher) -> None:
        del self.topics[publisher.topic]

    def trigger_configure(self) -> str:
        return str(self.on_configure(None))  # type: ignore[attr-defined]

    def trigger_activate(self) -> str:
        return str(self.on_activate(None))

    def destroy_node(self) -> None:
        self.topics.clear()

    def on_activate(self, _state: Any) -> str:
        for publisher in self.topics.values():
            publisher.is_active = True
        return "SUCCESS"

    def on_deactivate(self, _state: Any) -> str:
        for name in ("frame", "touch"):
            self.topics[name].is_active = False
        return "SUCCESS"

    def call(self, name: str, **request: Any) -> Any:
        """Call a service, as a client would."""
        _, call = self.offered[name]
        return call(types.SimpleNamespace(**request), types.SimpleNamespace(success=False, message=""))


class Transforms:
    """Keeps the static transforms on its node."""

    def __init__(self, node: Any) -> None:
        self.node = node

    def sendTransform(self, transform: Any) -> None:  # noqa: N802, the name in tf2_ros
        self.node.transform = transform


class Rclpy:
    """rclpy's functions for a process; `spin` is called in place of the executor."""

    nodes: ClassVar[list[LifecycleNode]] = []

    @staticmethod
    def init(args: Any = None) -> None:
        Rclpy.nodes.clear()

    @staticmethod
    def spin_until_future_complete(node: Any, future: Future) -> None:
        Rclpy.nodes.append(node)
        while not future.done():
            time.sleep(0.01)

    @staticmethod
    def try_shutdown() -> None:
        """Nothing is open."""


def node_module() -> Any:
    """The module of the sensor's node, imported with this stand-in in place of ROS 2."""
    messages = {
        "diagnostic_msgs": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
        "geometry_msgs": ("TransformStamped", "WrenchStamped"),
        "optopad_msgs": ("Contact", "Frame", "Sensor", "Touch"),
        "visualization_msgs": ("Marker",),
    }
    made: dict[str, dict[str, Any]] = {
        f"{room}.msg": {name: class_of(f"{room}/msg/{name}") for name in of} for room, of in messages.items()
    }
    made |= {
        "rclpy": {
            name: getattr(Rclpy, name) for name in ("init", "spin_until_future_complete", "try_shutdown")
        },
        "rclpy.clock": {
            "Clock": lambda clock_type: clock_type,
            "ClockType": types.SimpleNamespace(STEADY_TIME="steady"),
        },
        "rclpy.executors": {"ExternalShutdownException": type("ExternalShutdownException", (Exception,), {})},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "TransitionCallbackReturn": types.SimpleNamespace(SUCCESS="SUCCESS", FAILURE="FAILURE"),
        },
        "rclpy.qos": {
            "QoSProfile": lambda **given: given,
            "DurabilityPolicy": types.SimpleNamespace(TRANSIENT_LOCAL="kept"),
        },
        "rclpy.task": {"Future": Future},
        "rcl_interfaces.msg": {"ParameterDescriptor": types.SimpleNamespace},
        "std_srvs.srv": {"Trigger": object()},
        "optopad_msgs.srv": {"Record": object()},
        "tf2_ros.static_transform_broadcaster": {"StaticTransformBroadcaster": Transforms},
    }
    return imported(NODE, made)


class LaunchEntity:
    """An action or a description of launch: keeps what it was made with."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named


class ParameterValue(LaunchEntity):
    """A parameter in a launch file, as launch_ros evaluates it: text from an argument becomes the stated type."""

    def evaluated(self, arguments: dict[str, str]) -> Any:
        (configuration,), kind = self.given, self.named["value_type"]
        text = arguments[configuration.given[0]]
        if kind is bool:
            assert text.lower() in ("true", "false")
            return text.lower() == "true"
        return kind(text)


def launched(**given: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters that the launch file gives to the node for arguments of the command line, and how it starts it."""
    entities = ("LaunchDescription", "DeclareLaunchArgument", "LaunchConfiguration", "Node")
    made: dict[str, type] = {name: type(name, (LaunchEntity,), {}) for name in entities}
    rooms = ("launch", "launch.actions", "launch.substitutions", "launch_ros.actions")
    modules: dict[str, dict[str, Any]] = {
        room: {name: made[name]} for room, name in zip(rooms, entities, strict=True)
    }
    modules["launch_ros.parameter_descriptions"] = {"ParameterValue": ParameterValue}
    (actions,) = imported(LAUNCH, modules).generate_launch_description().given
    declared = {one.given[0]: one.named["default_value"] for one in actions if one.given}
    assert set(given) <= set(declared)
    (node,) = (one for one in actions if isinstance(one, made["Node"]))
    (parameters,) = node.named["parameters"]
    arguments = declared | given
    return {name: one.evaluated(arguments) for name, one in parameters.items()}, node.named


def imported(file: Path, made: dict[str, dict[str, Any]]) -> Any:
    """A module that is imported while the modules of ROS 2 have the given content."""
    before = dict(sys.modules)
    try:
        for name, content in made.items():
            for part in (name.rpartition(".")[0], name):
                if part and part not in made.keys() & sys.modules.keys():
                    sys.modules[part] = types.ModuleType(part)
            for key, value in content.items():
                setattr(sys.modules[name], key, value)
        spec = importlib.util.spec_from_file_location(file.name.partition(".")[0], file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        for name in set(sys.modules) - set(before):
            if name.split(".")[0] in {one.split(".")[0] for one in made}:
                del sys.modules[name]
    return module

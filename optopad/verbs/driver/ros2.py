"""Writes the ROS 2 packages of a sensor's node and its messages."""

from __future__ import annotations

from pathlib import Path

from optopad.cli.verb import require_folder, typed, verb
from optopad.fabrication.ros2 import write_packages
from optopad.screen.output import Told


@verb(out=typed("FOLDER", callback=require_folder))
def ros2(*, out: Path) -> Told:
    """Write the ROS 2 packages of a sensor's node and its messages into a workspace.

    Parameters
    ----------
    out : The src folder of a ROS 2 workspace.
    """
    made = [str(package) for package in write_packages(out)]
    lines = [
        f"packages  {', '.join(made)}",
        "next      python3 -m colcon build --packages-select optopad_msgs optopad_ros",
        "          ros2 launch optopad_ros sensor.launch.py config:=driver.toml",
    ]
    return Told({"packages": made}, lines)

"""ROS 2: the messages of optopad, and the packages that `optopad driver ros2` writes.

`optopad_msgs` and `optopad_ros` are data: they are copied into a workspace, and nothing here imports them.

Imports within this repository: optopad.design.errors, optopad.design.files.
"""

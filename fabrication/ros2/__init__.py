"""ROS 2: the messages of optopad, and the packages that `optopad driver ros2` and `python3 -m fabrication.ros2` write.

Imports within this repository: design.errors, design.files.
"""

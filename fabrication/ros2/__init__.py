"""ROS 2: the messages of optopad, and the packages that `optopad driver ros2` writes into a workspace.

Imports within this repository: design.errors, design.files.
"""

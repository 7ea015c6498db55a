"""The ROS 2 node of an optical touch pad."""

"""
Start one sensor, configured and active, and start it again if its process fails.

Every parameter of the node is an argument, in the type that the node has: 200 is a rate, and 1 a
name of coordinates. `use_sim_time` is no argument, so that a launch file which includes this one
can set it for all nodes.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    'config': ('', 'driver.toml of the sensor, or its bundle folder'),
    'port': ('', 'port of the board, or serial:NUMBER; empty: found by its USB identity'),
    'model': ('', 'trained model (.optomodel); empty: frames alone'),
    'touches': (1, 'most touches in a frame; 2 needs a model that knows two'),
    'rate': (-1.0, "frames per second; negative: the design's rate; 0: the board's highest"),
    'frame_id': ('optopad', 'coordinates of the pad'),
    'patience': (3.0, 'time without a frame after which the board counts as lost [s]'),
    'autostart': (True, 'configure and activate the node; false: a lifecycle manager does'),
}


def generate_launch_description():
    arguments = PARAMETERS | {'namespace': ('optopad', 'namespace of the topics')}
    return LaunchDescription([
        *(
            DeclareLaunchArgument(name, default_value=str(value), description=text)
            for name, (value, text) in arguments.items()
        ),
        Node(
            package='optopad_ros',
            executable='sensor',
            name='sensor',
            namespace=LaunchConfiguration('namespace'),
            parameters=[{
                name: ParameterValue(LaunchConfiguration(name), value_type=type(value))
                for name, (value, _) in PARAMETERS.items()
            }],
            output='screen',
            respawn=True,
            respawn_delay=2.0,
        ),
    ])

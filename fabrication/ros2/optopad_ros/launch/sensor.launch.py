"""Start one sensor, configure it, and activate it."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.actions import EmitEvent
from launch.actions import RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

ARGUMENTS = {
    'config': ('', 'driver.toml of the sensor, or its bundle folder'),
    'port': ('', 'port of the board; empty: found by its USB identity'),
    'model': ('', 'trained model (.optomodel); empty: frames alone'),
    'rate': ('-1.0', "frames per second; negative: the design's rate"),
    'frame_id': ('optopad', 'coordinates of the pad'),
    'namespace': ('optopad', 'namespace of the topics'),
}


def generate_launch_description():
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    names = [name for name in ARGUMENTS if name != 'namespace']
    sensor = LifecycleNode(
        package='optopad_ros',
        executable='sensor',
        name='sensor',
        namespace=LaunchConfiguration('namespace'),
        parameters=[{name: LaunchConfiguration(name) for name in names}],
        output='screen',
    )
    configure = EmitEvent(event=ChangeState(
        lifecycle_node_matcher=matches_action(sensor),
        transition_id=Transition.TRANSITION_CONFIGURE,
    ))
    activate = RegisterEventHandler(OnStateTransition(
        target_lifecycle_node=sensor,
        start_state='configuring',
        goal_state='inactive',
        entities=[EmitEvent(event=ChangeState(
            lifecycle_node_matcher=matches_action(sensor),
            transition_id=Transition.TRANSITION_ACTIVATE,
        ))],
    ))
    return LaunchDescription([*declared, activate, sensor, configure])

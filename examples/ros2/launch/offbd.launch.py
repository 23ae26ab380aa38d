from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    names = {"url": "http://127.0.0.1:8087", "asset": "rig"}
    return LaunchDescription(
        [
            *[DeclareLaunchArgument(name, default_value=value) for name, value in names.items()],
            Node(
                package="offbd_bridge",
                executable="offbd_bridge",
                parameters=[{name: LaunchConfiguration(name) for name in names}],
            ),
        ]
    )

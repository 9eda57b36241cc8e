"""Starts the bridge of one robot: `ros2 launch lineloom_bridge bridge.launch.py robot:=r1`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

_ARGUMENTS = {
    "url": ("", "Address of the service; LINELOOM_URL if left out."),
    "site": ("default", "One floor of one building."),
    "robot": ("robot", "This robot's name on the site."),
    "scan": ("scan", "Topic of the laser scans."),
    "odom": ("odom", "Topic of the odometry, with odometry:=topic."),
    "odometry": ("tf", "Where odometry comes from: tf, topic or none."),
}


def generate_launch_description() -> LaunchDescription:
    """Return the node with its arguments."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in _ARGUMENTS.items()
    ]
    given = {name: LaunchConfiguration(name) for name in ("url", "site", "robot", "odometry")}
    share = FindPackageShare("lineloom_bridge")
    defaults = PathJoinSubstitution([share, "config", "bridge.yaml"])
    node = Node(
        package="lineloom_bridge",
        executable="bridge",
        name="lineloom_bridge",
        output="screen",
        parameters=[defaults, given],
        remappings=[
            ("scan", LaunchConfiguration("scan")),
            ("odom", LaunchConfiguration("odom")),
        ],
    )
    return LaunchDescription([*declared, node])

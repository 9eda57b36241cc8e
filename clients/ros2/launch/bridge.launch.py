"""Starts the bridge of one robot: `ros2 launch lineloom_bridge bridge.launch.py robot:=r1`."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

_PARAMETERS = {
    "url": "Address of the service.",
    "site": "One floor of one building.",
    "robot": "This robot's name on the site.",
    "odometry": "Where odometry comes from: tf, topic or none.",
    "map_frame": "The map's frame; {component} in it stands for the component's id.",
    "odom_frame": "Odometry's frame.",
    "base_frame": "The base's frame.",
    "frame_prefix": "Before odom_frame and base_frame, e.g. r1/.",
}
"""Where left out, they are as params_file has them."""
_REMAPPED = {
    "scan": ("scan", "Topic of the laser scans."),
    "odom": ("odom", "Topic of the odometry, with odometry:=topic."),
    "/tf": ("tf", "Topic of transforms; tf:=/tf where robots of several namespaces share a tree."),
    "/tf_static": ("tf_static", "Topic of static transforms, likewise."),
}
_OTHERS = {
    "namespace": ("", "Namespace of the node and its topics, TF's included."),
    "use_sim_time": ("false", "Time from /clock."),
    "log_level": ("info", "debug, info, warn or error."),
}


def _node(context: LaunchContext) -> list[Node]:
    """Return the node. What was given by name beats params_file."""
    given = {name: LaunchConfiguration(name).perform(context) for name in _PARAMETERS}
    # As text whatever it looks like: a robot may be called 7.
    named = {name: ParameterValue(v, value_type=str) for name, v in given.items() if v}
    clock = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return [
        Node(
            package="lineloom_bridge",
            executable="bridge",
            name="lineloom_bridge",
            namespace=LaunchConfiguration("namespace"),
            output="screen",
            parameters=[LaunchConfiguration("params_file"), named, {"use_sim_time": clock}],
            remappings=[(topic, LaunchConfiguration(topic.lstrip("/"))) for topic in _REMAPPED],
            ros_arguments=["--log-level", LaunchConfiguration("log_level")],
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and the node made of them."""
    share = FindPackageShare("lineloom_bridge")
    usual = PathJoinSubstitution([share, "config", "bridge.yaml"])
    defaults = {topic.lstrip("/"): about for topic, about in _REMAPPED.items()} | _OTHERS
    declared = [
        DeclareLaunchArgument(name, default_value="", description=about)
        for name, about in _PARAMETERS.items()
    ]
    declared += [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in defaults.items()
    ]
    declared.append(
        DeclareLaunchArgument("params_file", default_value=usual, description="Parameters, YAML.")
    )
    return LaunchDescription([*declared, OpaqueFunction(function=_node)])

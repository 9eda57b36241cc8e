"""What ROS's tools make of the package: colcon builds it, launch finds its arguments."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml
from lineloom.bridge.settings import DEFAULTS

PACKAGE = Path(__file__).resolve().parents[3] / "clients" / "ros2"


def test_the_packaging_names_what_there_is() -> None:
    package = ET.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("name") == "lineloom_bridge"
    assert package.findtext("export/build_type") == "ament_python"
    depends = {e.text for e in package.findall("exec_depend")}
    node = (PACKAGE / "lineloom_bridge" / "node.py").read_text()
    froms = {line.split()[1].split(".")[0] for line in node.splitlines() if line.startswith("from")}
    assert froms - {"__future__", "types", "typing", "lineloom"} <= depends
    assert (PACKAGE / "resource" / "lineloom_bridge").exists()


def test_every_parameter_is_in_the_example_with_its_default() -> None:
    listed = yaml.safe_load((PACKAGE / "config" / "bridge.yaml").read_text())
    assert listed["/**"]["lineloom_bridge"]["ros__parameters"] == DEFAULTS


class Said:
    """Anything of launch's: keeps what it was made with."""

    def __init__(self, *values: Any, **named: Any) -> None:
        self.values, self.named = values, named

    def perform(self, context: dict[str, str]) -> str:
        """Of a LaunchConfiguration: what was given, or the default."""
        return context[self.values[0]]


def launch(given: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what the node would be started with; configurations by their values."""
    contents: dict[str, tuple[str, ...]] = {
        "launch": ("LaunchContext", "LaunchDescription"),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction"),
        "launch.substitutions": ("LaunchConfiguration", "PathJoinSubstitution"),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
        "launch_ros.parameter_descriptions": ("ParameterValue",),
        "launch_ros.substitutions": ("FindPackageShare",),
    }
    for name, classes in contents.items():
        module = ModuleType(name)
        module.__dict__.update(dict.fromkeys(classes, Said))
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("its", PACKAGE / "launch" / "bridge.launch.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    *arguments, function = module.generate_launch_description().values[0]
    context = {a.values[0]: a.named["default_value"] for a in arguments}
    assert given.keys() <= context.keys()
    context |= given
    (node,) = function.named["function"](context)

    def plain(value: Any) -> Any:
        if isinstance(value, Said) and value.named.get("value_type") is not None:
            return SimpleNamespace(value=plain(value.values[0]), kind=value.named["value_type"])
        return plain(value.perform(context)) if isinstance(value, Said) else value

    named: dict[str, Any] = node.named
    return {
        "namespace": plain(named["namespace"]),
        "remappings": {topic: plain(to) for topic, to in named["remappings"]},
        "log_level": plain(named["ros_arguments"][1]),
        "file": named["parameters"][0].perform(context),
        "parameters": {k: plain(v) for k, v in named["parameters"][1].items()},
        "use_sim_time": plain(named["parameters"][2]["use_sim_time"]),
    }


def test_a_robot_of_a_namespace_has_topics_tf_and_parameters_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = {"namespace": "r7", "robot": "7", "use_sim_time": "true", "params_file": "mine.yaml"}
    found = launch(given | {"log_level": "debug", "frame_prefix": "r7/"}, monkeypatch)
    assert found["namespace"] == "r7"
    topics = {"scan": "scan", "odom": "odom", "/tf": "tf", "/tf_static": "tf_static"}
    assert found["remappings"] == topics
    assert (found["file"], found["log_level"]) == ("mine.yaml", "debug")
    # Text even where it looks like a number; and what is not given is left to the file.
    assert {k: (v.value, v.kind) for k, v in found["parameters"].items()} == {
        "robot": ("7", str),
        "frame_prefix": ("r7/", str),
    }
    assert (found["use_sim_time"].value, found["use_sim_time"].kind) == ("true", bool)


def test_robots_may_share_a_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    found = launch({"tf": "/tf", "tf_static": "/tf_static"}, monkeypatch)
    assert found["remappings"]["/tf"] == "/tf"
    assert found["parameters"] == {}


def test_colcon_builds_it(tmp_path: Path) -> None:
    tools = Path(f"/tmp/lineloom-colcon-{os.getuid()}/bin")
    if not (tools / "colcon").exists():
        pytest.skip("no colcon here: .ci/colcon installs it")
    source = tmp_path / "src" / "lineloom_bridge"
    shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    environment = {n: v for n, v in os.environ.items() if not n.startswith("PYTHON")}
    environment |= {"COLCON_HOME": str(tmp_path / "home"), "PATH": f"{tools}:{os.environ['PATH']}"}
    built = subprocess.run(
        [tools / "colcon", "build", "--packages-select", "lineloom_bridge"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    installed = tmp_path / "install" / "lineloom_bridge"
    share = installed / "share" / "lineloom_bridge"
    assert (share / "launch" / "bridge.launch.py").exists()
    assert (share / "config" / "bridge.yaml").exists()
    assert (installed / "share/ament_index/resource_index/packages/lineloom_bridge").exists()
    assert (installed / "lib" / "lineloom_bridge" / "bridge").exists()
    assert list(installed.rglob("site-packages/lineloom_bridge/node.py"))

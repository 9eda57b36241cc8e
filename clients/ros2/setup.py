"""How colcon builds and installs the bridge."""

from setuptools import setup

NAME = "lineloom_bridge"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/bridge.launch.py"]),
        (f"share/{NAME}/config", ["config/bridge.yaml"]),
    ],
    install_requires=["setuptools", "lineloom-client"],
    zip_safe=True,
    maintainer="Lineloom",
    maintainer_email="maintainers@lineloom.example",
    description="Laser scans to a Lineloom service; poses and the map back.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"bridge = {NAME}.node:main"]},
)

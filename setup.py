"""The one declaration that colcon and pip build from."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "wind_sensors"
HERE = Path(__file__).parent
NODES = (
    "sim_node",
    "cup_vane_node",
    "propeller_vane_node",
    "propeller_array_node",
    "bivane_node",
    "monitor_node",
)
NUMBERS = ["numpy>=1.24", "scipy>=1.10", "numba>=0.58"]
FILES = ["rosbags>=0.11", "ruamel.yaml>=0.17.21", "pydantic>=2.7", "lz4", "tzdata"]
PEOPLE = ["rich>=12.4", "matplotlib>=3.6"]
ROS_WHEELS = [
    f"ros-jazzy-{package}"
    for package in (
        "rclpy",
        "rmw-fastrtps-cpp",
        "diagnostic-msgs",
        "geometry-msgs",
        "nav-msgs",
        "rosgraph-msgs",
        "sensor-msgs",
        "std-msgs",
    )
]


def share(folder: str, pattern: str) -> tuple[str, list[str]]:
    """The files of a folder under their place in the installation."""
    files = sorted(path.relative_to(HERE).as_posix() for path in (HERE / folder).glob(pattern))
    return f"share/{NAME}/{folder}".rstrip("/."), files


setup(
    name=NAME,
    version="0.1.0",
    description="Corrected wind from cups, propellers and vanes, on masts and on robots.",
    license="Apache-2.0",
    packages=find_packages(include=[NAME, f"{NAME}.*", "proving_ground", "proving_ground.*"]),
    package_data={NAME: ["py.typed", "**/*.html", "**/*.css"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        share("config", "*.yaml"),
        share("config/instruments", "*.yaml"),
        share("config/mappings", "*.yaml"),
    ],
    python_requires=">=3.10",
    install_requires=["setuptools", *NUMBERS, *FILES, *PEOPLE],
    extras_require={
        "ros": ROS_WHEELS,
        "test": ["pytest>=7.0", "pytest-xdist>=3.0", "hypothesis>=6.70"],
        "dev": ["mypy>=1.10", "ruff>=0.6", "scipy-stubs"],
        "peers": ["pysindy>=2.0", "sysidentpy>=0.9", "scikit-learn>=1.3"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "wind = wind_sensors.cli.main:main",
            *(f"{node} = wind_sensors.nodes.{node}:main" for node in NODES),
        ],
    },
)

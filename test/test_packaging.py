"""The declaration, the environment script and what they install agree with each other."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture
def declaration(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py declares."""
    caught: dict[str, Any] = {}
    monkeypatch.setattr("setuptools.setup", lambda **given: caught.update(given))
    monkeypatch.chdir(ROOT)
    code = compile((ROOT / "setup.py").read_text(encoding="utf-8"), "setup.py", "exec")
    exec(code, {"__file__": str(ROOT / "setup.py"), "__name__": "__main__"})
    return caught


@pytest.fixture
def bootstrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The script, with its commands recorded instead of run."""
    spec = importlib.util.spec_from_file_location("bootstrap", ROOT / "scripts" / "bootstrap.py")
    assert spec is not None and spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "VENV", tmp_path / ".venv")
    monkeypatch.setattr(module, "STAMP", tmp_path / ".venv" / "stamp")
    commands: list[tuple[str, ...]] = []

    def run(*command: str) -> None:
        commands.append(command)
        (tmp_path / ".venv" / "bin").mkdir(parents=True, exist_ok=True)
        (tmp_path / ".venv" / "bin" / "python").touch()

    monkeypatch.setattr(module, "run", run)
    module.commands = commands
    return module


def test_every_executable_is_declared_once_and_named_after_its_module(
    declaration: dict[str, Any],
) -> None:
    scripts = dict(s.split(" = ") for s in declaration["entry_points"]["console_scripts"])
    nodes = {"sim", "cup_vane", "propeller_vane", "propeller_array", "bivane", "monitor"}
    assert set(scripts) == {"wind", *(f"{node}_node" for node in nodes)}
    assert scripts["wind"] == "wind_sensors.cli.main:main"
    for node in nodes:
        assert scripts[f"{node}_node"] == f"wind_sensors.nodes.{node}_node:main"


def test_ros_finds_the_package(declaration: dict[str, Any]) -> None:
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert package.get("format") == "3"
    assert package.findtext("name") == declaration["name"] == "wind_sensors"
    assert package.findtext("version") == declaration["version"]
    assert package.findtext("license") == declaration["license"] == "Apache-2.0"
    assert package.findtext("export/build_type") == "ament_python"
    files = dict(declaration["data_files"])
    marker = files["share/ament_index/resource_index/packages"]
    assert [(ROOT / name).exists() for name in marker] == [True]
    assert "share/wind_sensors" in files
    assert declaration["extras_require"]["test"], "without it colcon test runs nothing"


NODES_WITHOUT = {"rosbags", "lz4", "rich", "matplotlib", "tzdata"}
"""Requirements of the commands alone."""

START_OF_A_NODE = f"""
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {NODES_WITHOUT!r}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Missing())
from importlib import import_module
for name in sys.argv[1:]:
    import_module(f"wind_sensors.nodes.{{name}}")
from wind_sensors.recordings import load_station
print(load_station("mast_cup_vane").instruments[0].name)
"""


def test_nodes_start_without_the_libraries_of_bags_and_screens() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    modules = {p.stem for p in (ROOT / "wind_sensors" / "nodes").glob("*.py")}
    # These two write bags, for `wind record` and `wind compose`.
    of_nodes = sorted(modules - {"__init__", "recorder", "composition"})
    assert {"estimator_node", "simulator", "monitor"} < set(of_nodes)
    started = subprocess.run(
        [sys.executable, "-c", START_OF_A_NODE, *of_nodes],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )
    assert (started.stdout, started.returncode) == ("cup\n", 0), started.stderr


def test_the_robot_recipe_names_every_requirement_once(declaration: dict[str, Any]) -> None:
    """By rosdep or by pip: what rosdep resolves is in package.xml, the rest in the README."""
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    by_rosdep = {d.text for d in package.iter("exec_depend")}
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    recipe = text[text.index("## On a robot") : text.index("| executable |")]
    (pip,) = re.findall(r"pip install .*", recipe)
    by_pip = set(re.findall(r"`([\w.]+)`", recipe)) | set(pip.replace('"', "").split())
    for requirement in declaration["install_requires"]:
        name = re.split(r"[><=]", requirement)[0]
        if name != "setuptools":
            named = {name, requirement} & by_pip
            assert bool(named) != (f"python3-{name}" in by_rosdep), requirement


def test_rosdep_knows_the_ros_packages_that_are_imported_and_what_the_tests_need(
    declaration: dict[str, Any],
) -> None:
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    imported = {
        name
        for file in (ROOT / "wind_sensors").rglob("*.py")
        for name in re.findall(r"^ *from (\w+)\.msg import", file.read_text("utf-8"), re.MULTILINE)
    }
    assert imported <= {d.text for d in package.iter("exec_depend")}
    needed = [re.split("[><=]", name)[0] for name in declaration["extras_require"]["test"]]
    assert {d.text for d in package.iter("test_depend")} == {f"python3-{name}" for name in needed}


def test_every_configuration_is_installed(declaration: dict[str, Any]) -> None:
    installed = {name for _, names in declaration["data_files"] for name in names}
    shipped = {p.relative_to(ROOT).as_posix() for p in (ROOT / "config").rglob("*.yaml")}
    assert shipped <= installed


def test_the_licence_is_whole() -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text and "END OF TERMS AND CONDITIONS" in text


def test_a_sourced_ros_is_used_through_system_site_packages(
    bootstrap: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap, "rclpy_is_importable", lambda: True)
    bootstrap.main(["test"])
    assert "--system-site-packages" in bootstrap.commands[0]
    assert bootstrap.commands[-1][-1] == ".[test]"


def test_elsewhere_the_wheels_are_installed_once(
    bootstrap: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap, "rclpy_is_importable", lambda: False)
    monkeypatch.setattr(bootstrap, "wheels_exist", lambda: True)
    bootstrap.main(["test"])
    assert "--system-site-packages" not in bootstrap.commands[0]
    assert bootstrap.commands[-1][-1] == ".[test,ros]"
    count = len(bootstrap.commands)
    bootstrap.main(["test"])
    assert len(bootstrap.commands) == count, "nothing changed, nothing to do"
    bootstrap.main(["test", "dev"])
    assert bootstrap.commands[-1][-1] == ".[test,dev,ros]"


def test_an_unsupported_platform_gets_one_sentence_and_the_offline_tools(
    bootstrap: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bootstrap, "rclpy_is_importable", lambda: False)
    monkeypatch.setattr(bootstrap.platform, "machine", lambda: "aarch64")
    bootstrap.main(["test"])
    told = capsys.readouterr().out
    assert len(re.findall(r"offline commands will", told)) == 1
    assert bootstrap.commands[-1][-1] == ".[test]"


def test_a_python_without_venv_or_too_old_gets_one_sentence(
    bootstrap: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap, "rclpy_is_importable", lambda: False)
    monkeypatch.setattr(bootstrap.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(SystemExit, match=r"apt-get install python3\.\d+-venv"):
        bootstrap.main(["test"])
    assert not bootstrap.commands
    monkeypatch.setattr(sys, "version_info", (3, 9, 2, "final", 0))
    with pytest.raises(SystemExit, match=r"needs Python 3\.10"):
        bootstrap.main(["test"])


def test_the_environment_of_other_wheels_is_not_inherited(
    bootstrap: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "1")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/elsewhere")
    assert "LD_LIBRARY_PATH" not in bootstrap.clean_environment()
    monkeypatch.delenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE")
    assert bootstrap.clean_environment()["LD_LIBRARY_PATH"] == "/elsewhere"


def test_the_readme_names_the_python_versions_that_the_script_takes(bootstrap: Any) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    oldest, newest = (".".join(map(str, v)) for v in (bootstrap.OLDEST, bootstrap.WHEELS_UP_TO))
    assert f"Python {oldest} to {newest}" in text
    script = (ROOT / "scripts" / "bootstrap.py").read_text(encoding="utf-8")
    assert f"CPython {oldest} to {newest}" in script

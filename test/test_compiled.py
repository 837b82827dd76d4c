"""Kernels are compiled once and kept."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from wind_sensors.compiled import is_kept

SOURCE = """
from wind_sensors.compiled import compiled


@compiled
def doubled(x: float) -> float:
    return 2.0 * x
"""


def loaded(folder: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("kernel_kept", folder / "kernel_kept.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_a_kernel_is_kept_once_it_has_run(tmp_path: Path) -> None:
    (tmp_path / "kernel_kept.py").write_text(SOURCE, encoding="utf-8")
    first = loaded(tmp_path).doubled
    assert not is_kept(first)
    assert first(3.0) == 6.0
    assert is_kept(first)

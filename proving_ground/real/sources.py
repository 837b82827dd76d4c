"""Where the real records come from: source distributions of packages that publish them."""

from __future__ import annotations

import gzip
import shutil
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

from wind_sensors.errors import UserError


@dataclass(frozen=True)
class Source:
    """A record: the mapping that imports it, the package with its version and licence, the ends
    of the paths of its files, and where they lie in a folder of copies."""

    mapping: str
    package: str
    version: str
    licence: str
    files: tuple[str, ...]
    copies: str


SOURCES = (
    Source(
        "mast_10min", "brightwind", "2.7.0", "MIT", ("demo_datasets/demo_data.csv",), "mast_10min"
    ),
    Source(
        "nrg_roof_1hz",
        "nrgpy",
        "2.3.13",
        "MIT",
        ("20240111_1300_000304_002994_onesecond.dat",),
        "roof_1hz",
    ),
    Source(
        "toa5_sonic",
        "fluxpart",
        "0.2.9",
        "CC0",
        (
            "TOA5_6843.ts_Above_2012_06_07_1245.dat",
            "TOA5_6843.ts_Above_2012_06_07_1300.dat",
        ),
        "sonic_20hz",
    ),
)


def fetch(source: Source, folder: Path, local: Path | None = None) -> list[Path]:
    """Bring the files of a source into a folder: from copies, or from the package index.

    Raises UserError if they cannot be had.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if local is not None:
        return _copy(source, folder, local / source.copies)
    with tempfile.TemporaryDirectory() as place:
        requirement = f"{source.package}=={source.version}"
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        command += ["--no-binary", ":all:", requirement, "-d", place]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        archives = list(Path(place).glob("*.tar.gz"))
        if done.returncode or not archives:
            raise UserError(
                f"{requirement} could not be downloaded",
                source.mapping,
                "Check the network, or give a folder of copies with --from.",
            )
        with tarfile.open(archives[0]) as archive:
            members = [m for m in archive if m.isfile() and m.name.endswith(source.files)]
            for member in members:
                content = archive.extractfile(member)
                assert content is not None
                with (folder / Path(member.name).name).open("wb") as target:
                    shutil.copyfileobj(content, target)
    return _all_of(source, folder)


def _copy(source: Source, folder: Path, copies: Path) -> list[Path]:
    for path in sorted(copies.glob("*")):
        name = path.name.removesuffix(".gz")
        if not (name.endswith(source.files) or name == "mast.csv"):
            continue
        if path.suffix == ".gz":
            with gzip.open(path, "rb") as packed, (folder / name).open("wb") as target:
                shutil.copyfileobj(packed, target)
        else:
            shutil.copy(path, folder / name)
    return _all_of(source, folder)


def _all_of(source: Source, folder: Path) -> list[Path]:
    found = sorted(p for p in folder.iterdir() if p.is_file())
    if len(found) < len(source.files):
        raise UserError(
            "files of a real record are missing",
            str(folder),
            f"Wanted: {', '.join(source.files)}.",
        )
    return found

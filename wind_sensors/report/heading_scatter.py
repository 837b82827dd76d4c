"""How much of a moving station's wind scatter was its own motion.

A carrier that takes several headings within some minutes shows the wind from several sides. What
it feels, taken for the wind, then scatters by its own motion; once the motion is removed, the
scatter that is left is the wind's own and the errors of the removal. Nothing is fitted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.estimation import ProcessedRecording
from wind_sensors.motion import PlatformTrack, frames, sensor_rotation, true_motion

FloatArray = npt.NDArray[np.float64]

BLOCK_SECONDS = 600.0
SEVERAL_HEADINGS = np.radians(30.0)
"""Circular standard deviation of the heading from which a block has several headings [rad]."""
_FULL_ENOUGH = 0.5
"""Share of a block that must have estimates."""


class BlockScatter(NamedTuple):
    """One block of time.

    Attributes:
        start: Seconds since the start of the recording.
        samples: Number of estimates.
        heading_spread: Circular standard deviation of the heading [rad].
        before: Mean square deviation of the felt wind, in the earth frame, from its mean [m^2/s^2].
        after: The same of the estimated wind.
    """

    start: float
    samples: int
    heading_spread: float
    before: float
    after: float


class HeadingScatter(NamedTuple):
    """Rms scatter of the horizontal wind vector about the means of its blocks [m/s].

    Attributes:
        blocks: Those that count.
        before: The apparent wind taken for the wind.
        after: The motion removed.
    """

    blocks: tuple[BlockScatter, ...]
    before: float
    after: float

    @property
    def ratio(self) -> float:
        """After over before."""
        return self.after / self.before


def block_scatters(found: ProcessedRecording) -> list[BlockScatter]:
    """Scatter in each block of ten minutes that is at least half full.

    Args:
        found: A processed recording of a station on a platform.

    Raises:
        UserError: The station has no platform.
    """
    recording = found.recording
    platform = recording.station.platform
    if platform is None or recording.platform is None:
        raise UserError("The station does not move.", recording.name)
    if found.time.size == 0:
        return []
    track = PlatformTrack(recording.platform)
    motion = true_motion(platform, track.at(found.time).motion, 1.0)
    heading = frames.heading_of(motion.attitude)
    in_platform = found.apparent @ sensor_rotation(platform).T
    felt = np.einsum("nij,nj->ni", motion.to_earth, in_platform)[:, :2]
    seconds = (found.time - recording.start) * 1e-9
    number = np.floor(seconds / BLOCK_SECONDS).astype(np.int64)
    fullest = np.bincount(number).max()
    out = []
    for k in np.unique(number):
        here = number == k
        count = int(np.count_nonzero(here))
        if count < _FULL_ENOUGH * fullest:
            continue
        resultant = float(np.abs(np.exp(1j * heading[here]).mean()))
        spread = float(np.sqrt(-2.0 * np.log(max(resultant, 1e-12))))
        before = float(felt[here].var(axis=0).sum())
        after = float(found.velocity[here, :2].var(axis=0).sum())
        out.append(BlockScatter(float(k) * BLOCK_SECONDS, count, spread, before, after))
    return out


def heading_scatter(
    found: ProcessedRecording, least_spread: float = float(SEVERAL_HEADINGS)
) -> HeadingScatter:
    """Scatter before and after the motion is removed, over the blocks with several headings.

    Args:
        found: A processed recording of a station on a platform.
        least_spread: Circular standard deviation of the heading from which a block counts [rad].

    Raises:
        UserError: The station has no platform, or no block has several headings.
    """
    blocks = tuple(b for b in block_scatters(found) if b.heading_spread >= least_spread)
    if not blocks:
        raise UserError(
            "No ten minutes of the recording have several headings.",
            found.recording.name,
            "Sail a circle, or ask for a smaller spread.",
        )
    count = sum(b.samples for b in blocks)
    before = sum(b.before * b.samples for b in blocks) / count
    after = sum(b.after * b.samples for b in blocks) / count
    return HeadingScatter(blocks, float(np.sqrt(before)), float(np.sqrt(after)))

"""Random numbers that belong to an event, not to the order in which events are computed.

Each number is a hash of seed, purpose and the event's index (SplitMix64), so that a live stream in
blocks and an offline run draw the same number for the same pulse or sample.
"""

from __future__ import annotations

import zlib

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_GOLDEN = 0x9E3779B97F4A7C15
_MASK = (1 << 64) - 1


def _mixed(z: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """The output function of SplitMix64 (Steele, Lea and Flood 2014)."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed: npt.NDArray[np.uint64] = z ^ (z >> np.uint64(31))
    return mixed


def uniform(seed: int, purpose: str, index: IndexArray) -> FloatArray:
    """Numbers in [0, 1) for events; independent between purposes.

    Args:
        seed: Any integer.
        purpose: What the numbers are for, e.g. `cup/loss`.
        index: Number of each event, shape (n,).

    Returns:
        Shape (n,).
    """
    start = (seed * 0xD1342543DE82EF95 + zlib.crc32(purpose.encode()) * _GOLDEN) & _MASK
    first = _mixed(np.array([start], dtype=np.uint64))
    steps = np.asarray(index, dtype=np.int64).view(np.uint64) * np.uint64(_GOLDEN)
    bits = _mixed(_mixed(first + steps) + np.uint64(_GOLDEN))
    fraction: FloatArray = (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return fraction


def normal(seed: int, purpose: str, index: IndexArray) -> FloatArray:
    """Standard normal numbers for events (Box and Muller); arguments as in `uniform`."""
    radius = np.sqrt(-2.0 * np.log1p(-uniform(seed, f"{purpose}/radius", index)))
    angle = 2.0 * np.pi * uniform(seed, f"{purpose}/angle", index)
    deviate: FloatArray = radius * np.cos(angle)
    return deviate

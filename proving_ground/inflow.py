"""Surface-layer turbulence as frozen fields over the wind run.

Fields are made in wavenumber, so that a wind that swells and dies down carries the same eddies
faster or slower past the mast. Spectra have the surface-layer shapes of Kaimal et al. (1972),
anisotropic, with a shear-driven correlation of the along-wind and vertical components.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID_SPACING = 0.1
CORRELATION_AT_LARGE_SCALE = 0.55


@dataclass(frozen=True)
class EddyField:
    """Unit-variance turbulence along the wind run at two places a little apart.

    reference, instrument: shape (n, 3), components along, across and up [1]; spacing [m].
    """

    spacing: float
    reference: Array
    instrument: Array

    def sample(self, place: Array, wind_run: Array) -> Array:
        """Components at each wind run [m]; `place` is one of the two fields. Shape (n, 3)."""
        position = wind_run / self.spacing
        left = np.clip(position.astype(np.int64), 0, len(place) - 2)
        weight = (position - left)[:, None]
        return place[left] * (1.0 - weight) + place[left + 1] * weight


def surface_layer_shape(reduced: Array) -> Array:
    """Kaimal et al. (1972) neutral shapes S(n)/u*^2 against n = f z / U, for u, v, w: (3, n)."""
    return np.stack(
        [
            105.0 / (1.0 + 33.0 * reduced) ** (5.0 / 3.0),
            17.0 / (1.0 + 9.5 * reduced) ** (5.0 / 3.0),
            2.1 / (1.0 + 5.3 * reduced ** (5.0 / 3.0)),
        ]
    )


def make_eddies(
    rng: np.random.Generator,
    length: float,
    height: float,
    separation: float,
    decay: float,
    longest_eddy: float,
) -> EddyField:
    """Draw the eddies of a record.

    length [m] is the wind run, height [m] the measuring height, separation [m] the distance
    between the two places; decay [1] is the exponent of the coherence exp(-decay k d / (2 pi)), in
    which k cannot fall below what the height allows; longest_eddy [m] is the scale beyond which
    variations belong to the slow wind.
    """
    count = int(scipy.fft.next_fast_len(int(length / GRID_SPACING) + 16, real=True))
    wavenumber = 2.0 * np.pi * scipy.fft.rfftfreq(count, GRID_SPACING)
    reduced = wavenumber * height / (2.0 * np.pi)
    shape = surface_layer_shape(reduced)
    shape *= 1.0 - np.exp(-((wavenumber * longest_eddy / (2.0 * np.pi)) ** 2))
    shape[:, 0] = 0.0
    amplitude = np.sqrt(shape)
    lateral = np.sqrt(wavenumber**2 + (0.3 / height) ** 2)
    coherence = np.exp(-decay * lateral * separation / (2.0 * np.pi))
    shared = CORRELATION_AT_LARGE_SCALE / (1.0 + (0.5 * reduced) ** (2.0 / 3.0))

    def draw() -> NDArray[np.complex128]:
        real, imaginary = rng.standard_normal((2, 3, wavenumber.size))
        return np.asarray(real + 1j * imaginary)

    def correlate(white: NDArray[np.complex128]) -> NDArray[np.complex128]:
        coloured = white.copy()
        coloured[2] = -shared * white[0] + np.sqrt(1.0 - shared**2) * white[2]
        return np.asarray(coloured * amplitude)

    here = draw()
    there = coherence * here + np.sqrt(1.0 - coherence**2) * draw()
    reference = scipy.fft.irfft(correlate(here), n=count, axis=1)
    instrument = scipy.fft.irfft(correlate(there), n=count, axis=1)
    scale = reference.std(axis=1)[:, None]
    return EddyField(GRID_SPACING, (reference / scale).T.copy(), (instrument / scale).T.copy())

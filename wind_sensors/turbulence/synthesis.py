"""Synthetic turbulence: u, v, w of given spectra, variances and lengths, as long as wanted.

A record is made of blocks. Each block is a periodic sum of random Fourier modes, seeded by its
own index; neighbours overlap by half with a taper whose squares add to one, so that variance and
spectrum are the same everywhere. A sample therefore depends on the seed and its index alone: the
same record comes out whole, in pieces of any size, or from any place on, in constant memory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.turbulence import inertial_range, surface_layer, von_karman
from wind_sensors.turbulence.modes import draw_modes, modal_variances, sum_modes, taper

FloatArray = npt.NDArray[np.float64]

_BLOCK_INTEGRAL_LENGTHS = 64.0
_SMALLEST_BLOCK = 1024
_LARGEST_BLOCK = 2**21


@dataclass(frozen=True)
class TurbulenceSpec:
    """A turbulent wind. Lengths in m, speeds in m/s, angles in rad.

    Attributes:
        mean_speed: U, positive.
        direction: Heading of the mean velocity (where the air goes), counter-clockwise from east.
        standard_deviations: sigma of u (along), v (to the left), w (up).
        integral_lengths: Longitudinal integral length L of the von Karman spectrum of each
            component, q = 0.7468/L; the same three for isotropic turbulence.
        uw_correlation: <uw>/(sigma_u sigma_w); negative near the ground.
        mean_vertical: Mean vertical velocity.
        slow_amplitude: Amplitude of a slow sinusoidal change of the mean speed.
        slow_period: Its period [s].
        slow_phase: Its phase at t = 0.
        turn_amplitude: Amplitude of a slow sinusoidal turn of the mean direction.
        turn_period: Its period [s]; None: that of the speed.
        seed: Any integer not negative.
    """

    mean_speed: float
    direction: float = 0.0
    standard_deviations: tuple[float, float, float] = (0.0, 0.0, 0.0)
    integral_lengths: tuple[float, float, float] = (50.0, 50.0, 50.0)
    uw_correlation: float = 0.0
    mean_vertical: float = 0.0
    slow_amplitude: float = 0.0
    slow_period: float = 600.0
    slow_phase: float = 0.0
    turn_amplitude: float = 0.0
    turn_period: float | None = None
    seed: int = 0

    def mean_wind(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Slowly changing mean speed [m/s] and heading [rad] at some times [s], shape (n,) each."""
        slow = np.sin(2.0 * math.pi * time / self.slow_period + self.slow_phase)
        period = self.slow_period if self.turn_period is None else self.turn_period
        turned = np.sin(2.0 * math.pi * time / period + self.slow_phase)
        speed = self.mean_speed + self.slow_amplitude * slow
        return speed, self.direction + self.turn_amplitude * turned


def isotropic_spec(
    mean_speed: float,
    intensity: float,
    integral_length: float,
    direction: float = 0.0,
    seed: int = 0,
) -> TurbulenceSpec:
    """Isotropic turbulence of intensity sigma/U [1] and longitudinal integral length [m]."""
    sigma = intensity * mean_speed
    return TurbulenceSpec(
        mean_speed=mean_speed,
        direction=direction,
        standard_deviations=(sigma, sigma, sigma),
        integral_lengths=(integral_length, integral_length, integral_length),
        seed=seed,
    )


def surface_layer_spec(
    mean_speed: float,
    height: float,
    roughness_length: float,
    stability: float = 0.0,
    ratios: surface_layer.VarianceRatios = surface_layer.PANOFSKY_DUTTON_RATIOS,
    direction: float = 0.0,
    seed: int = 0,
) -> TurbulenceSpec:
    """Anisotropic surface-layer turbulence with its momentum flux.

    The lengths are those at which each component's von Karman spectrum meets the inertial subrange
    of the dissipation u_*^3 phi_eps/(kappa z), so that small scales are isotropic.

    Args:
        mean_speed: U [m/s].
        height: z [m].
        roughness_length: z0 [m].
        stability: z/L_MO [1].
        ratios: Variances over u_*^2.
        direction: Heading of the mean velocity [rad].
        seed: Any integer not negative.
    """
    u_star = float(
        surface_layer.friction_velocity(mean_speed, height / roughness_length, stability)
    )
    dissipation = float(surface_layer.dissipation(u_star, height, stability))
    alpha_1 = surface_layer.ALPHA1_KAPPA43 / math.pow(surface_layer.VON_KARMAN_CONSTANT, 4.0 / 3.0)
    alpha = inertial_range.kolmogorov_constant_from_one_sided(alpha_1)
    variances = [ratio * u_star**2 for ratio in (ratios.u, ratios.v, ratios.w)]
    lengths = [
        von_karman.integral_length_from_wavenumber(
            dissipation / von_karman.dissipation_from_variance(variance, 1.0, alpha)
        )
        for variance in variances
    ]
    return TurbulenceSpec(
        mean_speed=mean_speed,
        direction=direction,
        standard_deviations=(
            math.sqrt(variances[0]),
            math.sqrt(variances[1]),
            math.sqrt(variances[2]),
        ),
        integral_lengths=(lengths[0], lengths[1], lengths[2]),
        uw_correlation=-1.0 / math.sqrt(ratios.u * ratios.w),
        seed=seed,
    )


class TurbulenceStream:
    """The wind of a `TurbulenceSpec`, sampled at a fixed rate, without end.

    Args:
        spec: The wind.
        sample_rate: Samples per second [1/s].

    Raises:
        ValueError: If the specification cannot be met (a negative deviation, a correlation of u
            and w that the two spectra do not allow).
    """

    def __init__(self, spec: TurbulenceSpec, sample_rate: float) -> None:
        _check(spec, sample_rate)
        self.spec = spec
        self.sample_rate = sample_rate
        self._size, wavenumber = _block_modes(spec, sample_rate)
        self._hop = self._size // 2
        rising = taper(self._hop)
        self._taper = np.concatenate([rising, rising[::-1]])
        self._variances = _component_variances(spec, wavenumber)
        self._shared = _shared_amplitude(spec, wavenumber, self._variances)
        self._blocks: dict[int, FloatArray] = {}
        self._position = 0

    @property
    def position(self) -> int:
        """Index of the sample that `read` returns next."""
        return self._position

    def seek(self, index: int) -> None:
        """Continue at sample `index`, counted from t = 0."""
        self._position = index

    def read(self, count: int) -> FloatArray:
        """The next `count` wind velocities, east, north, up [m/s], shape (count, 3)."""
        start = self._position
        velocity = self.at(start, count)
        self._position = start + count
        return velocity

    def at(self, start: int, count: int) -> FloatArray:
        """Wind velocities of samples start..start + count - 1, east, north, up [m/s]."""
        fluctuation = self.fluctuations(start, count)
        time = (start + np.arange(count)) / self.sample_rate
        speed, heading = self.spec.mean_wind(time)
        along = speed + fluctuation[:, 0]
        cosine, sine = np.cos(heading), np.sin(heading)
        out = np.empty((count, 3))
        out[:, 0] = along * cosine - fluctuation[:, 1] * sine
        out[:, 1] = along * sine + fluctuation[:, 1] * cosine
        out[:, 2] = self.spec.mean_vertical + fluctuation[:, 2]
        return out

    def fluctuations(self, start: int, count: int) -> FloatArray:
        """u, v, w [m/s] of samples start..start + count - 1, shape (count, 3)."""
        out = np.zeros((count, 3))
        first = start // self._hop - 1
        last = (start + count - 1) // self._hop
        for index in range(first, last + 1):
            begin = index * self._hop
            low = max(start, begin)
            high = min(start + count, begin + self._size)
            if low < high:
                block = self._block(index)
                out[low - start : high - start] += block[low - begin : high - begin]
        for index in [key for key in self._blocks if key < last - 1 or key > last]:
            del self._blocks[index]
        return out

    def _block(self, index: int) -> FloatArray:
        known = self._blocks.get(index)
        if known is not None:
            return known
        # Block -1 reaches into the record from before its start; the sequence needs index >= 0.
        sequence = np.random.SeedSequence((self.spec.seed, index + 1))
        generator = np.random.Generator(np.random.PCG64(sequence))
        amplitudes = draw_modes(generator, self._variances)
        if self.spec.uw_correlation != 0.0:
            # w is partly the mode of u, in phase, partly its own.
            own = np.sqrt(1.0 - self._shared**2)
            variance_u = np.maximum(self._variances[0], 1e-300)
            from_u = np.sqrt(self._variances[2] / variance_u) * amplitudes[0]
            amplitudes[2] = self._shared * from_u + own * amplitudes[2]
        block: FloatArray = np.asarray(sum_modes(amplitudes, self._size).T * self._taper[:, None])
        self._blocks[index] = block
        return block


def synthesize(spec: TurbulenceSpec, sample_rate: float, count: int) -> FloatArray:
    """Wind velocity, east, north, up [m/s], shape (count, 3): a `TurbulenceStream` read whole.

    Args:
        spec: The wind.
        sample_rate: Samples per second [1/s].
        count: Number of samples.

    Raises:
        ValueError: As for `TurbulenceStream`.
    """
    return TurbulenceStream(spec, sample_rate).read(count)


def largest_uw_correlation(spec: TurbulenceSpec, sample_rate: float) -> float:
    """Largest |<uw>|/(sigma_u sigma_w) that the spectra of u and w allow [1]."""
    equal = replace(spec, standard_deviations=(1.0, 1.0, 1.0), uw_correlation=0.0)
    _, wavenumber = _block_modes(equal, sample_rate)
    return _flux_of_full_coherence(equal, wavenumber, _component_variances(equal, wavenumber))


def _block_modes(spec: TurbulenceSpec, sample_rate: float) -> tuple[int, FloatArray]:
    """Samples per block, many integral lengths long, and the wavenumbers of its modes [1/m]."""
    travel = spec.mean_speed / sample_rate
    wanted = _BLOCK_INTEGRAL_LENGTHS * max(spec.integral_lengths) / travel
    size = 2 ** math.ceil(math.log2(max(wanted, _SMALLEST_BLOCK)))
    size = min(size, _LARGEST_BLOCK)
    return size, 2.0 * math.pi / (size * travel) * np.arange(size // 2 + 1)


def _component_variances(spec: TurbulenceSpec, wavenumber: FloatArray) -> FloatArray:
    """Modal variances of u, v, w, scaled so that each component has its variance exactly."""
    rows = []
    for axis in range(3):
        q = von_karman.wavenumber_from_integral_length(spec.integral_lengths[axis])
        shape = von_karman.longitudinal_spectrum if axis == 0 else von_karman.transverse_spectrum
        variance = modal_variances(shape(wavenumber, 1.0, q), float(wavenumber[1]))
        rows.append(variance * (spec.standard_deviations[axis] ** 2 / np.sum(variance)))
    return np.array(rows)


def _shared_amplitude(
    spec: TurbulenceSpec, wavenumber: FloatArray, variances: FloatArray
) -> FloatArray:
    """Coherence of u and w per mode: falls as k^(-2/3), as the surface layer's cospectrum does."""
    if spec.uw_correlation == 0.0:
        return np.zeros_like(wavenumber)
    full = _flux_of_full_coherence(spec, wavenumber, variances)
    strength = spec.uw_correlation / full
    if abs(strength) > 1.0:
        raise ValueError(
            f"the spectra of u and w allow a correlation of {full:.2f} at most, "
            f"not {abs(spec.uw_correlation):.2f}"
        )
    return np.asarray(strength * _coherence_shape(spec, wavenumber))


def _coherence_shape(spec: TurbulenceSpec, wavenumber: FloatArray) -> FloatArray:
    q = von_karman.wavenumber_from_integral_length(spec.integral_lengths[2])
    return np.asarray(np.power(1.0 + (wavenumber / q) ** 2, -1.0 / 3.0))


def _flux_of_full_coherence(
    spec: TurbulenceSpec, wavenumber: FloatArray, variances: FloatArray
) -> float:
    geometric = np.sqrt(variances[0] * variances[2])
    total = float(np.sum(_coherence_shape(spec, wavenumber) * geometric))
    return total / math.sqrt(float(np.sum(variances[0])) * float(np.sum(variances[2])))


def _check(spec: TurbulenceSpec, sample_rate: float) -> None:
    if spec.mean_speed <= 0.0:
        raise ValueError("the mean speed must be positive: spectra travel with the mean wind")
    if sample_rate <= 0.0:
        raise ValueError("the sample rate must be positive")
    if min(spec.standard_deviations) < 0.0 or min(spec.integral_lengths) <= 0.0:
        raise ValueError("standard deviations must not be negative, lengths must be positive")
    if spec.uw_correlation != 0.0 and min(spec.standard_deviations[0::2]) == 0.0:
        raise ValueError("a correlation of u and w needs fluctuations of both")
    if spec.slow_period <= 0.0 or spec.seed < 0:
        raise ValueError("the slow period must be positive and the seed not negative")

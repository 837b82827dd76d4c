"""Stations of the world: the instruments, what carries them, and random draws of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from proving_ground.blades import BladeGeometry
from proving_ground.cups import CupGeometry
from proving_ground.fins import FinGeometry

STANDARD_DENSITY = 1.225

LEAST_STEERING = 2.0
"""In a wind from behind, a fin's torque is at least so many times that of the propeller's drag."""


@dataclass(frozen=True)
class Shaft:
    """Inertia [kg m^2] and friction of a bearing: static, coulomb [N m], viscous [N m s] at
    15 deg C; grease [1/K] is the fall of the viscous part with temperature."""

    inertia: float
    static: float
    coulomb: float
    viscous: float
    grease: float


@dataclass(frozen=True)
class CupRotor:
    """A healthy cup anemometer."""

    geometry: CupGeometry
    shaft: Shaft
    concave: float
    convex: float
    pitch: float
    unevenness: float


@dataclass(frozen=True)
class Propeller:
    """A healthy propeller on the nose of a vane."""

    geometry: BladeGeometry
    shaft: Shaft


@dataclass(frozen=True)
class Vane:
    """A healthy vane."""

    geometry: FinGeometry
    shaft: Shaft


@dataclass(frozen=True)
class Boat:
    """How a boat moves: cruising speed [m/s], turn_rate [rad/s], rolling and pitching [rad] and
    wave_period [s]; sensor_position [m] forward, left, up of the point the odometry speaks of."""

    speed: float
    turn_rate: float
    roll: float
    pitch: float
    wave_period: float
    sensor_position: tuple[float, float, float]


@dataclass(frozen=True)
class Sonic:
    """The reference: separation [m] and its bearing [rad], path_length [m], noise [m/s], gain [1],
    yaw [rad] of its own mounting, rate [Hz], dropouts (mean count of gaps in ten minutes)."""

    separation: float
    bearing: float
    path_length: float
    noise: float
    gain: float
    yaw: float
    rate: float
    dropouts: float


@dataclass(frozen=True)
class Station:
    """One station as it is, healthy. kind: A mast with cup and vane, B boat with cup and vane,
    C mast with a propeller on the vane. lean [rad] and lean_bearing [rad] of the mast; decay is
    the coherence exponent of its site; sheet_errors are factors [1] on constants of its certificate
    by name; slots are the true places of the pulses in a turn [1]."""

    kind: str
    seed: int
    height: float
    vane: Vane
    rotor: CupRotor | Propeller
    pulses_per_revolution: int
    slots: tuple[float, ...]
    sonic: Sonic
    lean: float
    lean_bearing: float
    vane_rate: float
    decay: float
    boat: Boat | None = None
    sheet_errors: tuple[tuple[str, float], ...] = ()

    @property
    def rotor_name(self) -> str:
        """Name of the rotor in the recording."""
        return "propeller" if isinstance(self.rotor, Propeller) else "cup"


def random_station(kind: str, seed: int) -> Station:
    """Draw a station of a kind ("A", "B" or "C"); the same seed gives the same station."""
    from proving_ground.tunnel import tune_cup, tune_propeller

    if kind not in ("A", "B", "C"):
        raise ValueError(f"station kind {kind!r} is not one of A, B, C")
    rng = np.random.default_rng([seed, ord(kind), 71])
    rotor: CupRotor | Propeller
    vane = _random_vane(rng)
    if kind == "C":
        rotor = tune_propeller(_random_propeller(rng), float(rng.uniform(0.6, 1.8)))
        distance = float(rng.choice([0.0, 0.2, 0.35]))
        fin = vane.geometry._replace(
            propeller_distance=distance, propeller_drag=0.15 * np.pi * rotor.geometry.tip**2
        )
        vane = _steered(replace(vane, geometry=fin))
    else:
        rotor = tune_cup(_random_cup(rng), float(rng.uniform(1.2, 4.0)))
    pulses = int(rng.choice([1, 2, 4, 6, 10, 18, 24, 36]))
    spread = 0.0015 * rng.standard_normal(pulses)
    slots = (np.arange(pulses) + spread - spread.mean()) / pulses
    boat = _random_boat(rng) if kind == "B" else None
    return Station(
        kind=kind,
        seed=seed,
        height=float(rng.choice([4.0, 6.0, 10.0, 15.0, 20.0])),
        vane=vane,
        rotor=rotor,
        pulses_per_revolution=pulses,
        slots=tuple(float(s) for s in slots),
        sonic=_random_sonic(rng),
        lean=float(np.radians(abs(rng.normal(0.0, 0.4)))),
        lean_bearing=float(rng.uniform(-np.pi, np.pi)),
        vane_rate=20.0,
        decay=float(rng.uniform(14.0, 28.0)),
        boat=boat,
    )


def _random_sonic(rng: np.random.Generator) -> Sonic:
    return Sonic(
        separation=round(float(rng.uniform(0.3, 0.9)), 2),
        bearing=float(rng.uniform(-np.pi, np.pi)),
        path_length=round(float(rng.uniform(0.1, 0.2)), 2),
        noise=float(rng.uniform(0.01, 0.04)),
        gain=float(rng.normal(1.0, 0.002)),
        yaw=float(np.radians(rng.normal(0.0, 0.15))),
        rate=float(rng.choice([20.0, 25.0])),
        dropouts=float(rng.choice([0.0, 0.0, 2.0])),
    )


def _random_boat(rng: np.random.Generator) -> Boat:
    return Boat(
        speed=float(rng.uniform(1.5, 3.0)),
        turn_rate=float(rng.uniform(0.03, 0.07)),
        roll=float(np.radians(rng.uniform(3.0, 6.0))),
        pitch=float(np.radians(rng.uniform(1.5, 3.5))),
        wave_period=float(rng.uniform(3.5, 7.0)),
        sensor_position=(
            round(float(rng.uniform(-0.5, 0.5)), 1),
            0.0,
            round(float(rng.uniform(1.5, 4.0)), 1),
        ),
    )


def _random_shaft(rng: np.random.Generator, inertia: float, scale: float) -> Shaft:
    coulomb = scale * float(rng.uniform(0.5, 1.5))
    return Shaft(
        inertia=inertia,
        static=1.4 * coulomb,
        coulomb=coulomb,
        viscous=0.04 * coulomb * float(rng.uniform(0.5, 1.5)),
        grease=0.03,
    )


def _random_vane(rng: np.random.Generator) -> Vane:
    arm = float(rng.uniform(0.16, 0.5))
    distance_constant = float(rng.uniform(0.45, 1.1))
    area = float(rng.uniform(0.006, 0.014))
    slope = float(rng.uniform(2.4, 3.4))
    inertia = distance_constant**2 * 0.5 * STANDARD_DENSITY * area * slope * arm
    stiffness = 0.5 * STANDARD_DENSITY * area * slope * arm
    friction = stiffness * float(rng.uniform(0.002, 0.006))
    return Vane(
        FinGeometry(
            arm=arm,
            area=area,
            slope=slope,
            stall=float(np.radians(rng.uniform(20.0, 32.0))),
            plate=float(rng.uniform(1.05, 1.3)),
            nose_area=0.06 * area,
            nose_arm=0.4 * arm,
            stribeck_rate=0.05,
            propeller_distance=0.0,
            propeller_drag=0.0,
        ),
        Shaft(inertia, 1.3 * friction, friction, 0.0, 0.0),
    )


def _steered(vane: Vane) -> Vane:
    """The vane, with a fin that outweighs its propeller even in a wind from behind.

    A rotor in front of the axis would hold a small tail the wrong way round: nobody sells that.
    """
    fin = vane.geometry
    held = fin.propeller_drag * fin.propeller_distance
    larger = max(1.0, LEAST_STEERING * held / (fin.plate * fin.area * fin.arm))
    shaft = replace(
        vane.shaft,
        inertia=larger * vane.shaft.inertia,
        static=larger * vane.shaft.static,
        coulomb=larger * vane.shaft.coulomb,
    )
    return replace(vane, geometry=fin._replace(area=larger * fin.area), shaft=shaft)


def _random_cup(rng: np.random.Generator) -> CupRotor:
    arm = float(rng.uniform(0.045, 0.12))
    radius = arm * float(rng.uniform(0.38, 0.58))
    area = np.pi * radius**2
    return CupRotor(
        CupGeometry(
            cups=3,
            arm=arm,
            area=float(area),
            edge=float(rng.uniform(0.16, 0.3)),
            turn=float(rng.uniform(0.0, 0.2)),
            spill=float(rng.uniform(0.0, 0.45)),
            shelter=float(rng.uniform(0.05, 0.25)),
            stribeck_rate=4.0,
            cruise=2.5 * arm,
        ),
        _random_shaft(
            rng,
            STANDARD_DENSITY * float(area) * arm**2 * 3.0,
            0.06 * STANDARD_DENSITY * float(area) * arm,
        ),
        concave=float(rng.uniform(1.3, 1.5)),
        convex=float(rng.uniform(0.33, 0.45)),
        pitch=float(np.radians(rng.normal(0.0, 1.5))),
        unevenness=float(rng.normal(0.0, 0.004)),
    )


def _random_propeller(rng: np.random.Generator) -> Propeller:
    tip = float(rng.uniform(0.08, 0.13))
    geometry = BladeGeometry(
        blades=int(rng.choice([2, 3, 4])),
        hub=0.25 * tip,
        tip=tip,
        chord=0.35 * tip,
        pitch_run=float(rng.uniform(0.042, 0.08)),
        elements=4,
        stall=float(np.radians(rng.uniform(12.0, 16.0))),
        hub_shadow=float(rng.uniform(0.01, 0.06)),
        stribeck_rate=6.0,
        cruise=0.05,
    )
    return Propeller(
        geometry, _random_shaft(rng, STANDARD_DENSITY * tip**5, 0.003 * STANDARD_DENSITY * tip**3)
    )

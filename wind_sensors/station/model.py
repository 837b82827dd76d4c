"""The station: what is mounted, where, with which constants, and what is known to be wrong.

One schema serves recordings, simulations and node parameters. Everything that can be wrong with an
instrument is a key whose default is the healthy value, so that a station file can state it, the
simulator can plant it, the estimator can undo it and the diagnosis can fit it. All values are SI
with angles in radians, except keys that end in `_deg`.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from wind_sensors.station import moments, topic_names

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Vector3 = tuple[float, float, float]


STANDARD_DENSITY = 1.225
"""Air density of a calibration, and of air of which nothing is known [kg/m^3]."""


def _told(what: str, remedy: str) -> PydanticCustomError:
    """A fault of a value with its own remedy, for the validators."""
    return PydanticCustomError("told", "{what}", {"what": what, "remedy": remedy})


class Entry(BaseModel):
    """A part of the station file: unknown keys are errors, values do not change."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


class Input(Entry):
    """Where a signal comes from: any message type with a numeric field.

    A bare topic name in the file means the default type of that signal.
    """

    topic: str
    """Name of the topic; without a slash in front it counts from the node's namespace, and in a bag
    from the root. A recording's own file names what was recorded in a namespace in full."""
    type: str = ""
    """ROS message type, e.g. `std_msgs/msg/Header`; empty: the default of the signal."""
    field: str = ""
    """Numeric field, e.g. `position[0]`, `data`, `wind.speed`; empty: the default of the type."""
    meaning: Literal["", "edge", "edges", "count", "angle", "frequency", "value"] = ""
    """What the field holds: an edge's time, a batch of them, a running count of pulses, a
    cumulative angle [rad], a pulse frequency [Hz], or the value itself (for a rotor the speed it
    indicates [m/s]); empty: the default of the type."""
    scale: float = 1.0
    """SI value = scale * field + offset."""
    offset: float = 0.0
    """SI value = scale * field + offset."""
    modulus: float | None = Field(default=None, gt=0.0)
    """Value of the field at which a running count or angle wraps to zero."""
    steps: tuple[tuple[float, float], ...] = ()
    """Pairs (raw value, angle in degrees) of a stepped vane."""

    @field_validator("topic")
    @classmethod
    def _is_a_name(cls, topic: str) -> str:
        fault = topic_names.topic_name_fault(topic)
        if fault:
            raise _told(f"'{topic}' is not a ROS 2 topic name: it {fault}", topic_names.REMEDY)
        return topic


class WakeShadow(Entry):
    """Wind deficit behind an obstacle, Gaussian in the wind's direction."""

    bearing_from_deg: float
    """Direction the (apparent) wind comes from when the sensor is in the middle of the wake,
    counter-clockwise from the sensor's x axis, as a vane's heading."""
    depth: float = Field(ge=-1.0, le=1.0)
    """Relative loss of speed in the middle (negative: speed-up)."""
    width_deg: Positive
    """Standard deviation of the Gaussian."""
    flank: float = Field(default=0.0, ge=-0.5, le=0.5)
    """Relative speed-up beside the wake, at 2.8 widths on either side of its middle."""


class FlowDistortion(Entry):
    """Smooth speed-up and deflection around the mount, as a Fourier series in the wind direction.

    The direction the wind comes from, counter-clockwise from the sensor's x axis, is theta:
    speed factor 1 + c1 cos theta + s1 sin theta + c2 cos 2 theta + s2 sin 2 theta.
    """

    cosine_1: float = 0.0
    """c1"""
    sine_1: float = 0.0
    """s1"""
    cosine_2: float = 0.0
    """c2"""
    sine_2: float = 0.0
    """s2"""
    deflection: float = 0.0
    """Deflection of the wind that goes with it, 1 as in potential flow: counter-clockwise
    -deflection (c1 sin theta - s1 cos theta + c2 sin 2 theta - s2 cos 2 theta) [rad]"""


class Electronics(Entry):
    """From the shaft to the stamp: what the pulse circuit and the logger do to the edges."""

    dead_time: NonNegative = 0.0
    """Edges closer than this to the last accepted one are lost [s]."""
    loss_probability: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Share of the edges lost at random; with a growth, at an indicated speed of 5 m/s."""
    loss_growth: float = Field(default=0.0, ge=0.0, le=8.0)
    """Exponent with which that share grows with the rotor's rate: a weak pick-up loses pulses as
    the rotor races. Never more than 0.95 of them."""
    bounce_probability: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Share of the edges followed by a false one."""
    bounce_delay: Positive = 0.002
    """Mean delay of the false edges [s]; a contact closes again at any time up to twice that."""
    slot_errors: tuple[float, ...] = ()
    """Displacement of each slot, as a fraction of the nominal slot width; one per slot."""


class Clock(Entry):
    """Time stamps of one instrument against the truth."""

    latency: float = 0.0
    """Stamp minus time of measurement [s]."""
    drift: float = Field(default=0.0, gt=-0.1, lt=0.1)
    """Rate error of the instrument's clock [s/s], counted from the start of the recording."""


class Outage(Entry):
    """An interval in which the sensor repeats its last value (or delivers nothing, a rotor)."""

    start: float
    """Seconds since the start of the recording."""
    stop: float
    """Seconds since the start of the recording."""
    reading_deg: float | None = None
    """What a vane repeats; None: the last reading before."""


class Instrument(Entry):
    """What every instrument has."""

    name: str
    """Name within the station."""
    profile: str = ""
    """Name of the shipped profile whose constants were used as defaults."""
    clock: Clock = Clock()
    """Its stamps against the truth."""
    outages: tuple[Outage, ...] = ()
    """Intervals without new readings."""
    wake_shadows: tuple[WakeShadow, ...] = ()
    """Wakes of obstacles in which it stands."""
    flow_distortion: FlowDistortion = FlowDistortion()
    """What its mount does to the wind."""
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    """Lean of the axis towards the sensor's x and y, against the platform's up."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Place relative to the station's sensor position, in the sensor frame [m]."""


class Rotor(Instrument):
    """What cups and propellers share."""

    pulses: Input
    """Topic of the edges, counts, angles or frequencies."""
    pulses_per_revolution: int = Field(ge=1)
    """Edges in one turn."""
    calibration_distance: Positive
    """Wind run per radian l [m/rad]."""
    distance_constant: Positive
    """l0 [m], at the calibration's air density."""
    arm_radius: Positive | None = None
    """Distance of the cups' or blades' middle from the axis [m]."""
    a4: float = Field(default=1.0, gt=-1.0, lt=3.0)
    """Share of the torque's slope that follows the wind; 1 follows Kristensen et al. (2014) and, of
    propellers, Jackson. Nought is a propeller of Kristensen (1994), (30), which does not overspeed:
    that equation holds while the wind across is much less than that along the shaft."""
    reference_density: Positive = STANDARD_DENSITY
    """Air density of the calibration [kg/m^3]."""
    calibration_gain: Positive = 1.0
    """Steady rate relative to the calibration's."""
    calibration_offset: float = 0.0
    """Added to the steady reading [m/s]."""
    friction_speed: NonNegative = 0.0
    """U_s [m/s]: friction beyond the calibration's, as the speed whose torque it balances."""
    friction_breakaway: float = Field(default=1.0, ge=1.0, le=10.0)
    """Friction from which a rotor starts relative to that at which it stops. A cup's bearing that
    sticks lets go late; the blades of a braked propeller stall and drive it less at rest."""
    friction_temperature_coefficient: float = 0.0
    """c [1/K]: the friction goes with exp(c (T - T0)), as a grease's viscosity does; negative."""
    reference_temperature: float = 15.0
    """[deg C]"""
    inertia_factor: Positive = 1.0
    """Moment of inertia relative to the healthy rotor's."""
    torque_harmonic: NonNegative = 0.0
    """Amplitude of a once-per-turn torque, relative to that of the wind times the wind across the
    shaft: of a cup the whole wind, of a propeller what its vane does not follow."""
    torque_harmonic_phase_deg: float = 0.0
    """Rotor angle of the strong side."""
    electronics: Electronics = Electronics()
    """From the shaft to the stamp."""


class Cup(Rotor):
    """A cup anemometer, axis up."""

    kind: Literal["cup"] = "cup"
    """The kind of the instrument."""
    starting_speed: float = Field(default=0.0, ge=0.0, lt=5.0)
    """Calibration offset U0 [m/s]: l S = U - U0."""
    mu1: float = Field(default=0.0, gt=-2.0, lt=2.0)
    """Response to the vertical wind, first order, Kristensen (1994), (2)."""
    mu2: float = Field(default=0.0, gt=-3.0, lt=3.0)
    """Response to the vertical wind, second order: 0 cosine, 1 flat."""


class Propeller(Rotor):
    """A propeller, on a vane or on a fixed axis."""

    kind: Literal["propeller"] = "propeller"
    """The kind of the instrument."""
    mounted_on: str = ""
    """Name of the vane that carries it; empty: fixed along `axis`."""
    distance_to_vane_axis: float = 0.0
    """Upwind distance of the rotor from the vane's axis [m]."""
    axis: Vector3 | None = None
    """Unit vector of a fixed axis in the sensor frame; wind along it turns the rotor forward."""
    stall_speed: NonNegative = 0.0
    """U_s [m/s] of the healthy propeller: P omega = U - U_s^2/U."""
    angular_response_deg: tuple[float, ...] = ()
    """Angles of the values in `angular_response`, increasing from 0."""
    angular_response: tuple[float, ...] = ()
    """f(theta) at `angular_response_deg`; empty: cosine."""
    mu2: float | None = None
    """With a value, the propeller of Kristensen (1994), (30), instead of Jackson's."""
    angular_response_change: float = Field(default=0.0, gt=-3.0, lt=3.0)
    """Added curvature: f(theta) + change (1 - cos theta) cos theta."""

    @model_validator(mode="after")
    def _table_is_complete(self) -> Propeller:
        angles, values = self.angular_response_deg, self.angular_response
        if len(angles) != len(values):
            raise ValueError(
                f"angular_response has {len(values)} values for {len(angles)} angles in "
                "angular_response_deg: give one value per angle"
            )
        if any(b <= a for a, b in pairwise(angles)):
            raise ValueError("angular_response_deg must increase from 0 to 180")
        return self


class Angle(Instrument):
    """What vanes and bivanes share."""

    distance_constant: Positive
    """l_v [m], at the reference density."""
    damping_ratio: Positive
    """zeta, 1 at critical damping."""
    reference_density: Positive = STANDARD_DENSITY
    """Air density of `distance_constant` [kg/m^3]."""
    inertia_factor: Positive = 1.0
    """Moment of inertia relative to the healthy vane's."""
    damping_factor: NonNegative = 1.0
    """Damping relative to the healthy vane's."""
    viscous_damping: NonNegative = 0.0
    """Damping by oil or grease in the bearing, in units of the healthy vane's own at 8 m/s. It
    holds the vane against the mount, by as much in any wind."""
    friction_speed: NonNegative = 0.0
    """h_f [m/s]: the vane sticks while h^2 |sin(deviation)| < h_f^2."""
    imbalance: float = 0.0
    """b [1/m]: angular acceleration per acceleration across the nose."""
    play_deg: NonNegative = 0.0
    """Free angle of the coupling: the sensor follows the vane once that is taken up."""
    offset_deg: float = 0.0
    """Reading minus heading, counter-clockwise (mounting offset)."""
    reversed: bool = False
    """The sensor counts clockwise."""
    eccentricity_deg: NonNegative = 0.0
    """Amplitude of a once-per-turn reading error."""
    eccentricity_phase_deg: float = 0.0
    """Heading at which the eccentricity error passes zero upwards."""
    quantisation_deg: NonNegative = 0.0
    """Step of the encoder."""
    quantisation_origin_deg: float = 0.0
    """One of its readings."""
    gap_centre_deg: float = 0.0
    """Middle of the dead gap."""
    gap_width_deg: float = Field(default=0.0, ge=0.0, lt=360.0)
    """Dead gap of a potentiometer; inside it the reading is `gap_reading_deg`."""
    gap_reading_deg: float | Literal["floating"] | None = None
    """None: the reading stays at the nearest edge of the gap; `floating`: it may be anything."""
    filter_time_constant: NonNegative = 0.0
    """First-order low-pass on the angle [s]."""
    slew_limit_deg_s: NonNegative = 0.0
    """Fastest turn of the reading that the logger passes on; 0: any."""
    noise_deg: NonNegative = 0.0
    """Standard deviation of one reading's noise."""


class Vane(Angle):
    """A wind vane, axis up."""

    kind: Literal["vane"] = "vane"
    """The kind of the instrument."""
    joint_states: Input
    """Topic of the nose's heading, counter-clockwise from the sensor's x axis."""
    catch_speed: NonNegative = 0.0
    """h_c [m/s]: friction added (h_c^2 to h_f^2) where the race catches, at one heading."""
    catch_heading_deg: float = 0.0
    """That heading, counter-clockwise from the sensor's x axis."""
    catch_width_deg: Positive = 5.0
    """Standard width of the place."""
    fin_yield_speed: NonNegative = 0.0
    """Wind in which the fin, bent away, holds by half the force of a stiff one [m/s]; 0: stiff."""
    cable_speed: NonNegative = 0.0
    """h_k [m/s]: a cable that the vane winds up pulls per angle as wind of h_k does."""
    cable_rest_deg: float = 0.0
    """Heading at which it is not wound up; counted on over turns, so it may lie beyond 180."""


class Bivane(Angle):
    """A vane that follows azimuth and elevation."""

    kind: Literal["bivane"] = "bivane"
    """The kind of the instrument."""
    azimuth: Input
    """Topic of the nose's heading, counter-clockwise from the sensor's x axis."""
    elevation: Input
    """Topic of the tail's lift, positive when the wind blows upwards."""
    speed: str = ""
    """Name of the instrument whose speed sets the bivane's response."""


AnyInstrument = Annotated[Cup | Propeller | Vane | Bivane, Field(discriminator="kind")]


class Reference(Entry):
    """An independent wind in the recording, and how far it can be trusted."""

    kind: Literal["sonic", "tunnel", "truth"] = "sonic"
    """What measured it; `truth` comes from a simulator."""
    topic: Input
    """Topic of the wind velocity, east, north, up."""
    separation: NonNegative = 0.0
    """Distance from the station's sensors [m]."""
    path_length: NonNegative = 0.0
    """Length over which it averages [m]."""
    noise: NonNegative = 0.02
    """Standard deviation of one sample's noise [m/s]."""


class Air(Entry):
    """Topics of the air's state."""

    temperature: Input | None = None
    """Topic of the air temperature [deg C]."""
    pressure: Input | None = None
    """Topic of the air pressure [Pa]."""


class HeadingDeviation(Entry):
    """Compass error added to the true heading h: A + B sin h + C cos h + D sin 2h + E cos 2h."""

    constant_deg: float = 0.0
    """A"""
    sine_deg: float = 0.0
    """B"""
    cosine_deg: float = 0.0
    """C"""
    sine_2_deg: float = 0.0
    """D"""
    cosine_2_deg: float = 0.0
    """E"""


class Downwash(Entry):
    """Rotor inflow of a multirotor at the sensor.

    Its size is given as it was identified (`induced_velocity`), or by momentum theory from the
    rotors (`thrust` or `hover_power`, with `disc_area` and `sensor_share`).
    """

    induced_velocity: float = 0.0
    """Vertical induced velocity at hover, at the sensor [m/s], positive downwards."""
    wake_skew: float = 0.0
    """Horizontal share of it per unit of airspeed over induced velocity."""
    spread: tuple[float, float] = (0.0, 0.0)
    """Share of it that blows forward and to the left: off the rotors' axes the jet spreads."""
    thrust: NonNegative = 0.0
    """Of all rotors at hover [N], about the weight: v_h = sqrt(T / (2 rho A))."""
    hover_power: NonNegative = 0.0
    """Shaft power at hover [W], instead of `thrust`: v_h = (M P / (2 rho A))^(1/3)."""
    figure_of_merit: float = Field(default=0.7, gt=0.0, le=1.0)
    """M, ideal over shaft power at hover, with `hover_power`."""
    disc_area: NonNegative = 0.0
    """A, swept by all rotors together [m^2]."""
    sensor_share: float = Field(default=0.0, ge=-2.0, le=2.0)
    """Induced velocity at the sensor over that in the discs."""

    @model_validator(mode="after")
    def _one_source_with_its_area(self) -> Downwash:
        if self.thrust and self.hover_power:
            raise ValueError("give thrust or hover_power, not both")
        if (self.thrust or self.hover_power) and not self.disc_area:
            raise ValueError("thrust and hover_power need disc_area, the area of all rotors [m^2]")
        return self


class Platform(Entry):
    """The moving carrier of the station."""

    odometry: Input | None = None
    """Topic of attitude, velocity and position (nav_msgs/Odometry)."""
    imu: Input | None = None
    """Topic of attitude and angular rate (sensor_msgs/Imu), instead of odometry."""
    twist: Input | None = None
    """Topic of the velocity (geometry_msgs/TwistStamped), with `imu`; without it the platform is
    taken to turn but not to travel."""
    sensor_position: Vector3 = (0.0, 0.0, 0.0)
    """Sensor in the platform's frame (x forward, y left, z up) [m]."""
    sensor_rotation_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw of the sensor frame in the platform's frame."""
    velocity_scale: float = 1.0
    """Reported over true speed (log or GNSS scale error)."""
    frame: Literal["enu", "ned"] = "enu"
    """Convention of the odometry: ENU with forward-left-up axes, or NED with forward-right-down."""
    velocity_axes: Literal["platform", "earth"] = "platform"
    """Axes in which the velocity is reported."""
    velocity_turn_deg: float = 0.0
    """Turn of the reported velocity against those axes, counter-clockwise about up."""
    velocity_share: float = 1.0
    """Share of the platform's velocity that reaches the sensor's signals (0: already removed)."""
    position_share: float = 0.0
    """Share of the velocity that is taken from the change of the reported positions (1: all of it,
    for a log that reports nothing)."""
    heading_deviation: HeadingDeviation = HeadingDeviation()
    """Error of the compass."""
    downwash: Downwash = Downwash()
    """Rotor inflow at the sensor."""
    clock: Clock = Clock()
    """Its stamps against the truth."""
    heading_reference: Literal["true", "magnetic"] = "true"
    """What the reported heading counts from."""
    magnetic_declination_deg: float | None = None
    """Magnetic north minus true north, positive to the east; unset it counts as nought, and NMEA
    sentences leave the magnetic direction empty."""
    attitude_noise_deg: NonNegative = 0.5
    """Standard deviation of the reported attitude; covariances in the messages do not count."""
    velocity_noise: NonNegative = 0.05
    """Standard deviation of the reported velocity [m/s]; covariances in the messages do not
    count."""
    angular_rate_noise_deg: NonNegative = 0.0
    """Standard deviation of the reported angular rate [deg/s]; acts through `sensor_position`."""
    mounting_noise_deg: NonNegative = 0.0
    """Standard deviation of `sensor_rotation_deg` against the truth."""

    @property
    def moves_apart(self) -> bool:
        """Whether the velocity comes apart from the attitude, at times of its own."""
        return self.odometry is None and self.imu is not None and self.twist is not None


class Change(Entry):
    """Something that is different from one moment on, or for a while."""

    start: float = 0.0
    """Seconds since the start of the recording."""
    stop: float | None = None
    """None: to the end."""
    instrument: str
    """Name of the instrument, or `platform`."""
    set: dict[str, Any]
    """Keys of that entry with the values they have in the interval."""


class RecordingInfo(Entry):
    """When and where."""

    start: str = "1970-01-01T00:00:00Z"
    """First moment of the recording, UTC."""
    frame: str = "enu"
    """Name of the earth-fixed frame of the wind vectors (ENU). A live node of a station that states
    none says `map`."""
    averaging_time: NonNegative = 0.0
    """Every message is a mean over this time [s] and stamped at its end; 0: samples."""
    measuring_height: Positive = 10.0
    """Of the sensors above ground [m]."""
    roughness_length: Positive = 0.03
    """Of the ground upwind [m]."""

    @field_validator("start")
    @classmethod
    def _is_a_moment(cls, start: str) -> str:
        try:
            moments.nanoseconds(start)
        except ValueError as fault:
            raise _told(str(fault), moments.REMEDY) from None
        return start


class Station(Entry):
    """The whole station file."""

    recording: RecordingInfo = RecordingInfo()
    """When and where."""
    instruments: tuple[AnyInstrument, ...] = Field(min_length=1)
    """Cups, propellers, vanes, bivanes."""
    reference: Reference | None = None
    """An independent wind, if the recording has one."""
    air: Air = Air()
    """Topics of the air's state."""
    platform: Platform | None = None
    """The moving carrier; none on a mast."""
    sensor_heading_deg: float = 0.0
    """Heading of the sensor's x axis on a mast, counter-clockwise from east."""
    changes: tuple[Change, ...] = ()
    """What is different for a while or from one moment on."""

    @model_validator(mode="after")
    def _names_fit_together(self) -> Station:
        names = [i.name for i in self.instruments]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two instruments are called '{name}': give each its own name")
        for instrument in self.instruments:
            if isinstance(instrument, Propeller) and instrument.mounted_on:
                carriers = [v.name for v in self.instruments if isinstance(v, Vane)]
                if instrument.mounted_on not in carriers:
                    raise ValueError(
                        f"'{instrument.name}' is mounted on '{instrument.mounted_on}', which is "
                        f"not a vane of this station; vanes: {', '.join(carriers) or 'none'}"
                    )
        for change in self.changes:
            if change.instrument != "platform" and change.instrument not in names:
                raise ValueError(
                    f"a change names '{change.instrument}', which is not in the station; "
                    f"instruments: {', '.join(names)}"
                )
        return self

    def instrument(self, name: str) -> Cup | Propeller | Vane | Bivane:
        """The instrument of that name.

        Raises:
            KeyError: No instrument has the name.
        """
        for instrument in self.instruments:
            if instrument.name == name:
                return instrument
        raise KeyError(name)

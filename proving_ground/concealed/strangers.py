"""Causes that are in no catalogue. An amount of one is the smallest worth reporting."""

from __future__ import annotations

import numpy as np

from proving_ground.concealed.kinds import Cause, Parameters, active_at, pick_visited_bearing
from proving_ground.concealed.rotor import drag_for_loss
from proving_ground.concealed.vane import stiffness
from proving_ground.cups import CupTracks
from proving_ground.inflow import Array
from proving_ground.scene import Scene
from proving_ground.weather import wandering


def loose_mount(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A mount that swings in yaw at its own frequency once the wind sheds eddies fast enough."""
    frequency = float(scene.rng.uniform(0.8, 2.5))
    speed = np.hypot(scene.vane_flow[:, 0], scene.vane_flow[:, 1])
    onset = float(np.quantile(speed, 0.4))
    strength = activity / (1.0 + np.exp(-(speed - onset) / 0.4))
    phase = 2.0 * np.pi * frequency * scene.time
    phase = phase + 0.8 * wandering(scene.rng, scene.time, 3.0, 40.0)
    yaw = float(np.radians(2.5 * amount)) * strength * np.sin(phase)
    scene.angle_changes.append(lambda time, nose: nose + yaw)
    return {"frequency_hz": round(frequency, 3), "onset_speed": round(onset, 2)}


def radio_pulses(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A radio nearby: bursts of pulses at a fixed rate that the pick-up takes for its own."""
    rate = float(scene.rng.uniform(3.0, 9.0)) * (1.0 + amount)
    every = float(scene.rng.uniform(12.0, 40.0))
    length = float(scene.rng.uniform(1.0, 4.0))
    active = active_at(scene, activity)

    def join(edges: Array) -> Array:
        beat = np.arange(0.0, scene.duration, 1.0 / rate)
        beat = beat[(beat % every < length) & (active(beat) > 0.5)]
        return np.sort(np.concatenate([edges, beat]))

    scene.pulse_changes.append(join)
    return {"rate_hz": round(rate, 3), "every_s": round(every, 2), "burst_s": round(length, 2)}


def shaft_resonance(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A bent shaft that whirls, and loses power, near one rate."""
    speed = float(np.quantile(np.hypot(scene.rotor_flow[:, 0], scene.rotor_flow[:, 1]), 0.55))
    rotor = scene.station.rotor
    scene.rotor.resonance_rate[:] = speed / rotor.geometry.cruise
    scene.rotor.resonance_loss[:] = activity * drag_for_loss(rotor, 5.0, 0.5 * amount)
    return {"rate_rad_s": round(speed / rotor.geometry.cruise, 2)}


def worn_race(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A vane's bearing with a dent: it catches at one heading."""
    heading = pick_visited_bearing(scene)
    scene.vane.notch[:] += activity * stiffness(scene, 5.0) * float(np.radians(6.0 * amount))
    scene.vane.notch_heading[:] = heading
    return {"heading_deg": round(float(np.degrees(heading)), 1)}


def perched_bird(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A bird on the vane's tail: mass, drag on the turning and a shove now and then."""
    length = float(scene.rng.uniform(90.0, 240.0))
    begin = float(scene.rng.uniform(0.05, 0.6)) * scene.duration
    sits = activity * ((scene.time > begin) & (scene.time < begin + length))
    scene.vane.inertia[:] *= 1.0 + 4.0 * amount * sits
    shove = stiffness(scene, 5.0) * float(np.radians(5.0 * amount))
    moves = np.clip(wandering(scene.rng, scene.time, 1.0, 8.0), -2.0, 2.0)
    scene.vane.extra[:] += sits * shove * (1.0 + moves)
    return {"from_s": round(begin, 1), "to_s": round(begin + length, 1)}


def thermal_twist(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A mount that twists as the sun warms one side of it."""
    swing = scene.temperature - scene.temperature.mean()
    twist = np.radians(1.5 * amount) * swing / max(float(swing.std()), 1e-6) * activity
    scene.angle_changes.append(lambda time, nose: nose + twist)
    return {"deg_per_k": round(1.5 * amount / max(float(swing.std()), 1e-6), 4)}


def slew_limit(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A logger that refuses readings which jump: the vane's output may only turn so fast."""
    rate = float(np.radians(25.0 / amount))
    active = active_at(scene, activity)

    def follow(time: Array, angle: Array) -> Array:
        followed: Array = angle.copy()
        step = np.diff(time, prepend=time[0])
        on = active(time) > 0.5
        for i in range(1, angle.size):
            if on[i]:
                jump = (angle[i] - followed[i - 1] + np.pi) % (2.0 * np.pi) - np.pi
                followed[i] = followed[i - 1] + np.clip(jump, -rate * step[i], rate * step[i])
        return followed

    scene.reading_changes.append(follow)
    return {"deg_per_s": round(float(np.degrees(rate)), 2)}


def water_film(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Rain gathers on the rotor and is thrown off in gusts: a mass with a memory."""
    speed = np.hypot(scene.rotor_flow[:, 0], scene.rotor_flow[:, 1])
    limit = float(np.quantile(speed, 0.85))
    film = np.zeros_like(speed)
    level = 0.0
    pace = float(scene.time[1])
    for i, wind in enumerate(speed.tolist()):
        level += pace * ((1.0 - level) / 60.0 - (level / 1.5 if wind > limit else 0.0))
        film[i] = level
    drag = drag_for_loss(scene.station.rotor, 5.0, 0.12 * amount)
    scene.rotor.inertia[:] *= 1.0 + 1.2 * amount * film * activity
    scene.rotor.extra[:] -= drag * film * activity * (speed / 5.0) ** 2
    return {"thrown_off_at": round(limit, 2)}


def winding_cable(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A cable that winds up as the vane turns: it pulls the more, the farther from its rest."""
    heading = float(scene.rng.uniform(-np.pi, np.pi))
    scene.vane.spring[:] += activity * stiffness(scene, 5.0) * float(np.radians(2.0 * amount))
    scene.vane.spring_heading[:] = heading
    return {"heading_deg": round(float(np.degrees(heading)), 1)}


def sonic_shadow(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The reference's own heads shade its paths when the wind blows along one of three."""
    active = active_at(scene, activity)
    turn = float(scene.rng.uniform(0.0, np.pi / 3.0))

    def shade(time: Array, wind: Array) -> Array:
        angle = np.arctan2(wind[:, 1], wind[:, 0]) - turn
        loss = 0.02 * amount * np.abs(np.cos(1.5 * angle)) ** 6 * active(time)
        return np.asarray(wind * (1.0 - loss)[:, None])

    scene.reference_changes.append(shade)
    return {"turn_deg": round(float(np.degrees(turn)), 1)}


def backlash(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Play in the coupling between vane and encoder: the reading lags either way."""
    play = float(np.radians(2.5 * amount))

    def coupled(time: Array, nose: Array) -> Array:
        shaft: Array = nose.copy()
        for i in range(1, nose.size):
            free = play * activity[i]
            shaft[i] = min(max(shaft[i - 1], nose[i] - free), nose[i] + free)
        return shaft

    scene.angle_changes.append(coupled)
    return {"play_deg": round(float(np.degrees(play)), 3)}


def rain_burst(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Minutes of heavy drops that strike the cups against their turning."""
    length = float(scene.rng.uniform(80.0, 200.0))
    begin = float(scene.rng.uniform(0.05, 0.6)) * scene.duration
    falls = (scene.time > begin) & (scene.time < begin + length)
    drops = scene.rng.poisson(0.12, scene.time.size) * scene.rng.exponential(1.0, scene.time.size)
    drag = drag_for_loss(scene.station.rotor, 5.0, 0.3 * amount)
    scene.rotor.extra[:] -= activity * falls * drops * drag * 8.0
    return {"from_s": round(begin, 1), "to_s": round(begin + length, 1)}


def busy_logger(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A logger that writes to its card now and then and stamps what it missed afterwards."""
    every = float(scene.rng.uniform(5.0, 15.0))
    pause = float(min(0.25 * amount, 0.4 * every))
    active = active_at(scene, activity)

    def wait(time: Array) -> Array:
        inside = (time % every < pause) & (active(time) > 0.5)
        late = np.floor(time / every) * every + pause
        order = np.arange(time.size) % 50
        return np.where(inside, late + 2e-6 * order, time)

    scene.stamp("rotor", wait)
    return {"every_s": round(every, 3), "pause_s": round(pause, 3)}


def crosstalk(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A common ground: the vane's reading shifts with the current that the rotor's pick-up draws,
    which goes with its rate."""
    speed = np.hypot(scene.rotor_flow[:, 0], scene.rotor_flow[:, 1])
    pace = scene.time[1] / 1.5
    slow = np.empty_like(speed)
    level = float(speed[0])
    for i, wind in enumerate(speed.tolist()):
        level += pace * (wind - level)
        slow[i] = level
    shift = np.radians(1.6 * amount) * (slow / float(speed.mean())) ** 2 * activity
    scene.angle_changes.append(lambda time, nose: nose + shift)
    return {"deg_at_mean_wind": round(1.6 * amount, 3)}


def twisting_blades(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Soft blades or arms that give way to the pressure of the wind."""
    if isinstance(scene.rotor, CupTracks):
        speed = np.hypot(scene.rotor_flow[:, 0], scene.rotor_flow[:, 1])
        slow = np.convolve(speed, np.ones(100) / 100.0, mode="same")
        scene.rotor.concave[:] *= 1.0 - 0.015 * amount * activity * (slow / 8.0) ** 2
    else:
        scene.rotor.washout[:] += activity * 0.004 * amount
    return {"amount": round(amount, 3)}


def swaying_mast(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A slender mast that sways, and carries its instruments through the air, as gusts push it."""
    frequency = float(scene.rng.uniform(0.25, 0.7))
    aside = float(scene.rng.uniform(-np.pi, np.pi))
    speed = np.hypot(scene.rotor_flow[:, 0], scene.rotor_flow[:, 1])
    growing = 1.0 + 0.5 * np.clip(wandering(scene.rng, scene.time, 5.0, 60.0), -1.5, 1.5)
    sway = 0.04 * amount * speed.mean() * growing * np.sin(2.0 * np.pi * frequency * scene.time)
    for flow in (scene.rotor_flow, scene.vane_flow):
        flow[:, 0] -= activity * sway * np.cos(aside)
        flow[:, 1] -= activity * sway * np.sin(aside)
    return {"frequency_hz": round(frequency, 3), "towards_deg": round(float(np.degrees(aside)), 1)}


def turning_radar(scene: Scene, amount: float, activity: Array) -> Parameters:
    """An antenna close by, whose bar shields the instruments twice a turn."""
    period = float(scene.rng.uniform(1.8, 4.0))
    passing = np.abs(np.cos(np.pi * scene.time / period)) ** 12
    shielded = (1.0 - 0.07 * amount * passing * activity)[:, None]
    scene.rotor_flow *= shielded
    scene.vane_flow *= shielded
    return {"period_s": round(period, 3)}


def soft_tail(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A fin that bends away from the wind's pressure and then holds the vane less."""
    speed = np.hypot(scene.vane_flow[:, 0], scene.vane_flow[:, 1])
    bent = 0.2 * amount * (speed / 6.0) ** 2
    scene.vane.density[:] *= 1.0 - activity * bent / (1.0 + bent)
    return {"share_lost_at_6_m_s": round(0.2 * amount / (1.0 + 0.2 * amount), 3)}


def sagging_supply(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A supply that sags while a radio sends: the vane's voltage, and its reading, fall with it."""
    every = float(scene.rng.uniform(20.0, 70.0))
    sending = float(scene.rng.uniform(0.15, 0.4)) * every
    active = active_at(scene, activity)

    def sag(time: Array, angle: Array) -> Array:
        depth = 0.02 * amount * (time % every < sending) * active(time)
        return np.asarray((angle % (2.0 * np.pi)) * (1.0 - depth))

    scene.reading_changes.append(sag)
    return {"every_s": round(every, 2), "sending_s": round(sending, 2)}


def holding_reference(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A reference whose driver repeats the last good numbers while drops sit on its heads."""
    every = float(scene.rng.uniform(8.0, 25.0))
    held = float(min(0.9 * amount, 0.7 * every))
    active = active_at(scene, activity)

    def hold(time: Array, wind: Array) -> Array:
        wet = (time % every < held) & (active(time) > 0.5)
        last = np.where(wet, 0, np.arange(time.size))
        return np.asarray(wind[np.maximum.accumulate(last)])

    scene.driver_changes.append(hold)
    return {"every_s": round(every, 2), "held_s": round(held, 2)}


STRANGERS: dict[str, Cause] = {
    "loose_mount": Cause("station", loose_mount),
    "radio_pulses": Cause("rotor", radio_pulses),
    "shaft_resonance": Cause("rotor", shaft_resonance),
    "worn_race": Cause("vane", worn_race),
    "perched_bird": Cause("vane", perched_bird),
    "thermal_twist": Cause("station", thermal_twist),
    "slew_limit": Cause("vane", slew_limit),
    "water_film": Cause("rotor", water_film),
    "winding_cable": Cause("vane", winding_cable),
    "sonic_shadow": Cause("reference", sonic_shadow),
    "backlash": Cause("vane", backlash),
    "rain_burst": Cause("rotor", rain_burst),
    "busy_logger": Cause("rotor", busy_logger),
    "crosstalk": Cause("vane", crosstalk),
    "twisting_blades": Cause("rotor", twisting_blades),
    "swaying_mast": Cause("station", swaying_mast),
    "turning_radar": Cause("station", turning_radar),
    "soft_tail": Cause("vane", soft_tail),
    "sagging_supply": Cause("vane", sagging_supply),
    "holding_reference": Cause("reference", holding_reference),
}

"""Causes between the shaft and the log: electronics, encoders, clocks."""

from __future__ import annotations

import numpy as np

from proving_ground.concealed.kinds import Cause, Parameters, active_at
from proving_ground.inflow import Array
from proving_ground.measure import wrap
from proving_ground.scene import Scene


def missed_pulses(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A dead time after each pulse, or a weak pick-up that loses pulses as the rotor races."""
    dead = bool(scene.rng.random() < 0.7)
    active = active_at(scene, activity)
    answer: Parameters = {"share_wanted": round(amount, 4)}

    def blind(edges: Array) -> Array:
        wait = _dead_time_for(edges, amount)
        answer["dead_time_s"] = float(f"{wait:.4g}")
        return _drop_within(edges, wait, active)

    def weak(edges: Array) -> Array:
        interval = np.gradient(edges)
        fast = np.median(interval) / interval
        chance = amount * fast**2 / float(np.mean(fast**2)) * active(edges)
        kept = scene.rng.random(edges.size) >= chance
        answer["weak_pick_up"] = True
        return np.asarray(edges[kept])

    scene.pulse_changes.append(blind if dead else weak)
    return answer


def _dead_time_for(edges: Array, share: float) -> float:
    """Dead time [s] that loses about a share of the pulses."""
    low, high = 0.0, float(np.quantile(np.diff(edges), 0.9))
    for _ in range(25):
        middle = 0.5 * (low + high)
        kept = _drop_within(edges, middle, np.ones_like)
        low, high = (low, middle) if 1.0 - kept.size / edges.size > share else (middle, high)
    return high


def _drop_within(edges: Array, wait: float, active: object) -> Array:
    assert callable(active)
    on = active(edges) > 0.5
    kept = np.ones(edges.size, dtype=bool)
    last = -np.inf
    for i, edge in enumerate(edges.tolist()):
        if on[i] and edge - last < wait:
            kept[i] = False
        else:
            last = edge
    return np.asarray(edges[kept])


def extra_pulses(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A reed contact that bounces: some edges come twice within milliseconds."""
    active = active_at(scene, activity)
    gap = float(scene.rng.uniform(0.0005, 0.003))

    def bounce(edges: Array) -> Array:
        chance = amount * active(edges)
        again = edges[scene.rng.random(edges.size) < chance]
        later = again + gap * scene.rng.exponential(1.0, again.size)
        return np.sort(np.concatenate([edges, later]))

    scene.pulse_changes.append(bounce)
    return {"share": round(amount, 4), "bounce_time_s": round(gap, 5)}


def encoder_slot_error(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Badly cut slots: one far out of place and the others a little."""
    count = scene.slots.size
    active = active_at(scene, activity)
    error = 0.35 * amount * scene.rng.standard_normal(count)
    error[int(scene.rng.integers(count))] += amount * float(scene.rng.choice([-1.0, 1.0]))
    error = np.clip(error - error.mean(), -0.45, 0.45)

    def displace(edges: Array) -> Array:
        interval = np.gradient(edges)
        slot = np.arange(edges.size) % count
        return np.sort(edges + active(edges) * error[slot] * interval)

    scene.slot_changes.append(displace)
    return {"slot_errors": [round(float(e), 4) for e in error]}


def vane_offset(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The vane was mounted turned."""
    offset = float(np.radians(amount)) * float(scene.rng.choice([-1.0, 1.0]))
    scene.angle_changes.append(lambda time, nose: nose + offset * activity)
    return {"offset_deg": round(float(np.degrees(offset)), 3)}


def vane_eccentricity(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The code disc sits off its shaft: the reading head sees the angle from another centre."""
    shift = float(np.sin(np.radians(amount)))
    toward = float(scene.rng.uniform(-np.pi, np.pi))

    def read(time: Array, nose: Array) -> Array:
        seen = np.arctan2(np.sin(nose - toward), np.cos(nose - toward) + shift)
        return np.asarray(nose + activity * wrap(seen - (nose - toward)))

    scene.angle_changes.append(read)
    return {"amplitude_deg": round(amount, 3), "toward_deg": round(float(np.degrees(toward)), 1)}


def potentiometer_gap(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The wiper leaves the track over a gap; the input then floats, or falls to one end."""
    width = float(np.radians(amount))
    active = active_at(scene, activity)
    floats = bool(scene.rng.random() < 0.5)
    answer: Parameters = {"width_deg": round(amount, 3), "floats": floats}

    def leave(time: Array, angle: Array) -> Array:
        place = float(angle[int(scene.rng.uniform(0.25, 0.75) * angle.size)])
        answer["centre_deg"] = round(float(np.degrees(place)), 2)
        gone = (np.abs(wrap(angle - place)) < 0.5 * width) & (active(time) > 0.5)
        read: Array = angle.copy()
        if floats:
            read[gone] = scene.rng.uniform(-np.pi, np.pi, int(gone.sum()))
        else:
            read[gone] = place - 0.5 * width
        return read

    scene.reading_changes.append(leave)
    return answer


def quantisation(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A coarse encoder: whole steps of a turn."""
    steps = max(4, round(360.0 / amount))
    step = 2.0 * np.pi / steps
    active = active_at(scene, activity)

    def coarse(time: Array, angle: Array) -> Array:
        whole = np.floor(angle / step) * step + 0.5 * step
        return np.where(active(time) > 0.5, whole, angle)

    scene.reading_changes.append(coarse)
    return {"step_deg": round(360.0 / steps, 4)}


def low_pass_filter(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A resistor and a capacitor behind the vane's sine and cosine outputs."""

    def smooth(time: Array, nose: Array) -> Array:
        pace = (time[1] - time[0]) / (amount + time[1] - time[0])
        turned = np.exp(1j * nose)
        slow = _first_order(turned, pace)
        return np.asarray(nose + activity * np.angle(slow / turned))

    scene.angle_changes.append(smooth)
    return {"time_constant_s": round(amount, 4)}


def _first_order(signal: object, pace: float) -> Array:
    from scipy.signal import lfilter

    values = np.asarray(signal)
    start = values[:1] * (1.0 - pace)
    return np.asarray(lfilter([pace], [1.0, pace - 1.0], values, zi=start)[0])


def sensor_swap(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The two tracks of the vane's encoder are exchanged at the plug: it counts clockwise."""
    active = active_at(scene, activity)
    scene.reading_changes.append(lambda time, angle: np.where(active(time) > 0.5, -angle, angle))
    return {"counts": "clockwise"}


def stuck_sensor(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A vane frozen in place or a rotor held still for a while."""
    length = min(amount, 0.4 * scene.duration)
    begin = float(scene.rng.uniform(0.1, 0.9) * (scene.duration - length))
    end = begin + length
    answer: Parameters = {"from_s": round(begin, 2), "to_s": round(end, 2)}
    if scene.rng.random() < 0.5:
        answer["instrument"] = "vane"

        def freeze(time: Array, angle: Array) -> Array:
            held: Array = angle.copy()
            inside = (time >= begin) & (time < end)
            held[inside] = angle[int(np.argmax(inside))]
            return held

        scene.reading_changes.append(freeze)
    else:
        scene.pulse_changes.append(lambda edges: edges[(edges < begin) | (edges >= end)])
    return answer


def timestamp_latency(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Stamps put on arrival, not at the sensor."""
    active = active_at(scene, activity)
    channel = str(scene.rng.choice(["rotor", "vane"]))
    scene.stamp(channel, lambda time: time + amount * active(time))
    return {"latency_s": round(amount, 4), "instrument": _named(scene, channel)}


def clock_drift(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A logger's clock that gains or loses against the reference's."""
    active = active_at(scene, activity)
    sign = float(scene.rng.choice([-1.0, 1.0]))
    pace = sign * amount / scene.duration
    channel = str(scene.rng.choice(["rotor", "vane"]))

    def gain(time: Array) -> Array:
        return time + pace * time * active(time)

    for each in ["rotor", "vane"] if scene.rng.random() < 0.4 else [channel]:
        scene.stamp(each, gain)
        channel = each
    both = len(scene.stamp_changes) > 1
    return {
        "drift_ppm": round(1e6 * pace, 2),
        "instrument": "station" if both else _named(scene, channel),
    }


def _named(scene: Scene, channel: str) -> str:
    return scene.station.rotor_name if channel == "rotor" else channel


CAUSES: dict[str, Cause] = {
    "missed_pulses": Cause("rotor", missed_pulses),
    "extra_pulses": Cause("rotor", extra_pulses),
    "encoder_slot_error": Cause("rotor", encoder_slot_error),
    "vane_offset": Cause("vane", vane_offset),
    "vane_eccentricity": Cause("vane", vane_eccentricity),
    "potentiometer_gap": Cause("vane", potentiometer_gap),
    "quantisation": Cause("vane", quantisation),
    "low_pass_filter": Cause("vane", low_pass_filter),
    "sensor_swap": Cause("vane", sensor_swap),
    "stuck_sensor": Cause("rotor", stuck_sensor),
    "timestamp_latency": Cause("rotor", timestamp_latency),
    "clock_drift": Cause("rotor", clock_drift),
}

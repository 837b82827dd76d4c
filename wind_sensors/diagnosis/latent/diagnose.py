"""The diagnosis of a moving platform whose wind nobody else measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import PLATFORM, Effect
from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.latent.headings import (
    BLOCK,
    FEWEST_BLOCKS,
    Felt,
    bench_of,
    felt_by,
    heading_spread,
    residual_of,
)
from wind_sensors.diagnosis.means.bench import Bench
from wind_sensors.diagnosis.means.corrected import corrected, uncorrected
from wind_sensors.diagnosis.means.detectable import smallest_size
from wind_sensors.diagnosis.means.findings import last_set, too_small
from wind_sensors.diagnosis.means.fits import fit, held_out, intervals
from wind_sensors.diagnosis.means.proofs import proof_of, share_removed
from wind_sensors.diagnosis.means.search import Explained, Named, needed_t, search, t_of
from wind_sensors.diagnosis.outcome import Outcome, Panel
from wind_sensors.diagnosis.proving.findings import Estimate, Finding, Unexplained
from wind_sensors.diagnosis.proving.rules import verdict_on_findings
from wind_sensors.diagnosis.regions import Found, Region
from wind_sensors.errors import UserError
from wind_sensors.motion.frames import compass_from_yaw, heading_of
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

EFFECTS = (
    "platform_velocity", "platform_velocity_scale", "heading_deviation", "vane_offset",
    "calibration_drift",
)
"""Effects that a wind which must be the same from all headings can show."""

SEVERAL_HEADINGS = np.radians(20.0)
"""Circular deviation of the heading [rad] from which a block shows several headings."""

FEWEST_TURNING = 4
"""So many blocks must show several headings."""

NOT_SEPARABLE = {
    ("calibration_drift", "platform_velocity_scale"): (
        "Only the ratio of the anemometer's gain and the scale of the platform's speed is seen: "
        "the wind, unknown itself, takes up the rest. A run in calm air separates them."
    ),
    ("vane_offset", "heading_deviation"): (
        "A turned vane and a compass with a constant error look the same while the wind is "
        "unknown. Sighting the vane's mark along the keel separates them."
    ),
}


def latent_effects(station: Station) -> dict[str, Effect]:
    """The effects, with what the station file states as the healthy value of the motion."""
    known = catalogue()
    found = {name: replace(known[name], everywhere=False) for name in EFFECTS}
    share = station.platform.velocity_share if station.platform is not None else 1.0
    velocity = found["platform_velocity"]
    parameter = replace(velocity.parameters[0], low=-0.5, high=2.0, healthy=share, starts=())
    found["platform_velocity"] = replace(
        velocity, parameters=(parameter,), templates=({"velocity_share": share + 0.1},), size=None
    )
    return found


def is_latent(recording: Recording) -> bool:
    """Whether a recording has a moving platform and no reference."""
    return recording.reference is None and recording.platform is not None


def diagnose_latent(
    recording: Recording, progress: Callable[[str, float], None] | None = None
) -> Outcome:
    """Find the physics that a station file leaves out on a moving platform without reference.

    Args:
        recording: With a rotor, a vane and a platform.
        progress: Called with a phase and the share of it that is done.

    Raises:
        UserError: There is no rotor with a vane, or the record is too short.
    """
    felt = felt_by(recording)
    station = recording.station
    spread = heading_spread(felt)
    turning = int(np.count_nonzero(spread > SEVERAL_HEADINGS))
    if spread.size < FEWEST_BLOCKS:
        raise UserError(
            f"{spread.size} blocks of {BLOCK:.0f} s with wind and motion are too few.",
            recording.name,
            "Record for an hour or more.",
        )
    bench = bench_of(felt, station)
    explained = search(
        bench, latent_effects(station), (PLATFORM, felt.vane, felt.rotor),
        lambda share: progress("headings", share) if progress else None, 3,
    )
    findings = _findings(felt, bench, explained)
    declined = _declined(bench, station, explained)
    verdict = verdict_on_findings(findings, Unexplained(1.0, 0.0, (), ""), 1.0)
    if verdict == "none" and turning < FEWEST_TURNING:
        verdict = "inconclusive"
    to_plant, notes = _with_whole_motion(bench, explained, findings)
    small = [too_small(t, station) for t in explained.terms if t.relative_size < 1.0]
    after = planted(station, explained.terms)
    return Outcome(
        recording=recording.name,
        verdict=verdict,
        calibrated=False,
        findings=findings,
        unexplained=Unexplained(explained.p, 0.0, (), ""),
        smallest_detectable=_smallest(felt, bench, after),
        station=corrected(station, to_plant),
        start=recording.start,
        length=(recording.stop - recording.start) * 1e-9,
        reference=f"latent: the earth wind, constant with a trend within {BLOCK:.0f} s; "
        f"{turning} of {spread.size} blocks show several headings",
        declined=(*notes, *small, *declined, *uncorrected(findings)),
        panels=_panels(felt, station, after),
    )


def _twins(named: Named) -> dict[tuple[str, str], tuple[Term, float]]:
    """Other explanations of a finding that are large enough to matter, by effect."""
    return {
        t.key: (t, b)
        for t, b in reversed(named.equal)
        if t.key != named.term.key and t.relative_size >= 1.0
    }


def _with_whole_motion(
    bench: Bench, explained: Explained, findings: Sequence[Finding]
) -> tuple[list[Finding], tuple[str, ...]]:
    """The findings, the motion taken as a whole where held-out blocks do not contradict."""
    out, notes = [], []
    needed = needed_t(bench)
    for finding in findings:
        if finding.term.effect.name != "platform_velocity" or finding.set_number:
            out.append(finding)
            continue
        whole = replace(finding.term, values={"velocity_share": 1.0})
        rest = [t for t in explained.terms if t is not finding.term]
        cost, _ = held_out(bench, [(whole,), (whole,)], rest)
        t = t_of(cost - explained.cost[-1])
        fitted = finding.term.values["velocity_share"]
        if t < needed:
            out.append(replace(finding, term=whole))
            notes.append(
                f"a velocity share other than 1: the fit of {fitted:.2f} is not better than the "
                f"whole motion on held-out blocks (t = {t:.1f}, {needed:.1f} needed); the "
                "corrected station has 1."
            )
        else:
            out.append(finding)
    return out, tuple(notes)


def _placebo(felt: Felt, bench: Bench, term: Term) -> FloatArray | None:
    """What the same effect gains with the platform's velocity of another time."""
    if term.effect.name not in {"platform_velocity", "platform_velocity_scale"}:
        return None
    platform = bench.station.platform
    assert platform is not None
    # The velocity of another time as it would have been in the earth's axes.
    turn = np.ones(len(felt), dtype=np.complex128)
    if platform.velocity_axes == "platform":
        turn = np.exp(1j * heading_of(felt.motion.attitude))
    plane = (felt.motion.velocity[:, 0] + 1j * felt.motion.velocity[:, 1]) * turn
    plane = np.roll(plane, len(felt) // 3) / turn
    velocity = np.column_stack((plane.real, plane.imag, felt.motion.velocity[:, 2]))
    moved = replace(felt.motion, velocity=velocity)
    other = bench_of(replace(felt, motion=moved), bench.station)
    other = replace(other, noise=bench.noise)
    cost, _ = held_out(other, [(), ()], (term,))
    nothing, _ = held_out(other, [(), ()], ())
    return nothing - cost


def _findings(felt: Felt, bench: Bench, explained: Explained) -> tuple[Finding, ...]:
    limits = intervals(bench, explained.terms)
    out: list[Finding] = []
    for k, (named, term) in enumerate(zip(explained.named, explained.terms, strict=True)):
        if term.relative_size < 1.0:
            continue
        before = explained.cost[k]
        placebo = _placebo(felt, bench, term)
        # How much of the misfit is gusts, which nothing removes, nobody knows: shares are of all.
        proof = proof_of(named.gain, before, bench.noise.size, placebo)
        twins = _twins(named)
        number = 1 + last_set(out) if twins else 0
        found = residual_of(felt, bench.station, np.ones(len(felt), dtype=bool))
        region = Region(
            "apparent_wind", "heading", 0.0, 360.0, "between the headings within ten minutes"
        )
        size = float(np.sqrt(np.mean(np.abs(found) ** 2)))
        place = Found(region, float(named.gain.sum()), size, "m/s")
        parameters = {
            p.name: Estimate(term.values[p.name], *limits[k][p.name], p.unit)
            for p in term.effect.parameters
        }
        others = tuple((t.effect.name, t.instrument, b) for t, b in twins.values())
        others += tuple((t.effect.name, t.instrument, b) for t, b in named.others[:4])
        out.append(
            Finding(
                term, parameters, place, proof.excess_removed, named.p, others, proof, number,
            )
        )
        for other, behind in twins.values():
            values = {
                p.name: Estimate(other.values[p.name], float("nan"), float("nan"), p.unit)
                for p in other.effect.parameters
            }
            out.append(
                Finding(
                    other, values, place, proof.excess_removed, named.p,
                    ((term.effect.name, term.instrument, -behind),), None, number,
                )
            )
    return tuple(out)


def _declined(bench: Bench, station: Station, explained: Explained) -> tuple[str, ...]:
    """What each other effect would say, and why it is not said."""
    effects = latent_effects(station)
    given = {t.effect.name for t in explained.terms}
    lines = []
    vanes = [i.name for i in station.instruments if effects["vane_offset"].applies(i, station)]
    rotors = [
        i.name for i in station.instruments if effects["calibration_drift"].applies(i, station)
    ]
    places = {"vane_offset": vanes[0], "calibration_drift": rotors[0]}
    _, halves = held_out(bench, [(), ()], explained.terms)
    base = explained.cost[-1]
    for name, effect in effects.items():
        if name in given or name in {"platform_velocity", "platform_velocity_scale"}:
            continue
        start = Term(effect, places.get(name, PLATFORM), effect.templates[0])
        cost, _ = held_out(bench, halves, (start,))
        best = fit(bench, explained.terms, (start,), bench.everything)[0]
        limits = intervals(bench, (*explained.terms, best))[-1]
        gain = base - cost
        values = ", ".join(
            f"{p.name.replace('_', ' ')} {best.values[p.name]:.2f} "
            f"({limits[p.name][0]:.2f} to {limits[p.name][1]:.2f}) {p.unit}".removesuffix(" 1")
            + (f", {p.sense}" if p.sense else "")
            for p in effect.parameters
        )
        share = 100.0 * share_removed(gain, base, np.zeros(base.size))
        lines.append(
            f"{name.replace('_', ' ')}: the best fit is {values}; on held-out blocks it "
            f"{'lowers' if share > 0.0 else 'raises'} the misfit by {abs(share):.1f} % "
            f"(t = {t_of(gain):.1f}, {needed_t(bench):.1f} needed), which is no ground for a "
            "correction."
        )
    platform = station.platform
    for pair, text in NOT_SEPARABLE.items():
        # A velocity in the platform's own axes turns with the compass: then only the vane is seen.
        turns_along = platform is not None and platform.velocity_axes == "platform"
        if not given & set(pair) and not ("heading_deviation" in pair and turns_along):
            lines.append(text)
    return tuple(lines)


def _smallest(felt: Felt, bench: Bench, station: Station) -> dict[str, SmallestSize]:
    """Sizes of the effects that the record would have shown, by effect and instrument."""
    effects = latent_effects(station)
    change = bench.change(station)
    found = {}
    for name, place in (
        ("platform_velocity", PLATFORM), ("heading_deviation", PLATFORM),
        ("vane_offset", felt.vane), ("calibration_drift", felt.rotor),
    ):
        term = Term(effects[name], place, effects[name].templates[0])
        found[f"{name}/{place}"] = smallest_size(
            bench, station, term, change(term.planted(station))
        )
    return found


def _panels(felt: Felt, before: Station, after: Station) -> tuple[Panel, ...]:
    """Scatter of the apparent wind about the best slowly changing wind."""
    everything = np.ones(len(felt), dtype=bool)
    one = np.abs(residual_of(felt, before, everything))
    two = np.abs(residual_of(felt, after, everything))
    count = np.bincount(felt.block)
    when = np.asarray(np.bincount(felt.block, felt.elapsed) / count / 60.0, dtype=np.float64)
    rms = [np.asarray(np.sqrt(np.bincount(felt.block, r**2) / count)) for r in (one, two)]
    compass = compass_from_yaw(heading_of(felt.motion.attitude))
    sector = np.floor(compass / 30.0).astype(np.intp)
    filled = np.bincount(sector, minlength=12) > 20
    at = np.asarray((np.arange(12) * 30.0 + 15.0)[filled], dtype=np.float64)
    size = np.maximum(np.bincount(sector, minlength=12), 1)
    by = [np.sqrt(np.bincount(sector, r**2, 12) / size)[filled] for r in (one, two)]
    return (
        Panel(
            "apparent wind against ten-minute winds", "minutes", when, rms[0], rms[1],
            np.asarray(rms[0] / np.sqrt(count)), "rms, m/s",
        ),
        Panel(
            "apparent wind against ten-minute winds", "heading [deg]", at, by[0], by[1],
            by[0] / np.sqrt(size[filled]), "rms, m/s",
        ),
    )

"""Residuals and signatures of a recording as plain arrays, for other methods to regress on.

`python -m wind_sensors.report.regressors RECORDING -o FILE.npz` writes what `wind diagnose` itself
sees in the time domain, before any baseline: the peers of the proving ground start from it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.signatures import signature_bank, templates_of
from wind_sensors.errors import UserError
from wind_sensors.recordings import read_recording


def write_residual(recording: Path, target: Path, station: Path | None = None) -> None:
    """Write `residual`, `channel` and the slow apparent `speed` [m/s] alone.

    The residual is against the recording's own station, or another file's.
    """
    comparison = prepare(read_recording(recording, station))
    without = comparison.simulate(comparison.station)
    names = [c.name for c in comparison.channels]
    np.savez_compressed(
        target,
        residual=np.concatenate([comparison.measured.series[n] - without.series[n] for n in names]),
        channel=np.repeat(np.arange(len(names)), comparison.grid.n),
        speed=comparison.speed,
    )


def write_regressors(recording: Path, target: Path, workers: int = 1) -> None:
    """Write the regressors of a recording.

    The file holds `residual` (n) [m/s], recorded minus simulated, of all channels one after the
    other; `signatures` (n, m), simulated with minus without each template; `effects` (m) their
    names; `sizes` (m) in units of the smallest worth reporting; `channel` (n) which channel.

    Raises:
        UserError: The recording cannot be read or compared.
    """
    comparison = prepare(read_recording(recording))
    station = comparison.station
    bank = signature_bank(
        comparison, station, templates_of(comparison, station, catalogue()), workers
    )
    names = [c.name for c in comparison.channels]
    measured = np.concatenate([comparison.measured.series[n] for n in names])
    without = np.concatenate([bank.without.series[n] for n in names])
    with_each = [np.concatenate([s.series[n] for n in names]) for s in bank.with_each]
    np.savez_compressed(
        target,
        residual=measured - without,
        signatures=np.stack(with_each, axis=1) - without[:, None],
        effects=np.array([t.effect.name for t in bank.templates]),
        sizes=np.array([t.effect.relative_size(t.values) for t in bank.templates]),
        channel=np.repeat(np.arange(len(names)), comparison.grid.n),
    )


def main() -> int:
    """Write the regressors of one recording; 0 on success, 2 for a recording that cannot be."""
    parser = argparse.ArgumentParser(prog="python -m wind_sensors.report.regressors")
    parser.add_argument("recording", type=Path, metavar="RECORDING")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--residual", action="store_true", help="the residual alone, no signatures")
    parser.add_argument("--station", type=Path, metavar="FILE", help="with --residual: another one")
    options = parser.parse_args()
    try:
        if options.residual:
            write_residual(options.recording, options.output, options.station)
        else:
            write_regressors(options.recording, options.output)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""What a watch can be told."""

from __future__ import annotations

from dataclasses import dataclass

from wind_sensors.errors import UserError


@dataclass(frozen=True)
class WatchSettings:
    """How to watch; times in seconds.

    Attributes:
        drive: `reference`: the wind of a topic drives the simulation. `instruments`: that of other
            instruments of the station, `driving`, through their own inverse model. `estimate`: the
            station's own estimate; then only pulse intervals, spectra and the readings themselves
            are compared.
        driving: Names of the instruments that drive, for `instruments`.
        block: Length of the blocks.
        lead_in: The simulation starts so much before each block.
        learning: Blocks from which normal is learnt before anything is judged.
        false_alarms_per_day: Accepted.
        wait: Messages that come later than this are not waited for.

    Raises:
        UserError: A value is out of range.
    """

    drive: str = "reference"
    driving: tuple[str, ...] = ()
    block: float = 60.0
    lead_in: float = 10.0
    learning: int = 10
    false_alarms_per_day: float = 0.05
    wait: float = 2.0

    def __post_init__(self) -> None:
        if self.drive not in ("reference", "instruments", "estimate"):
            raise UserError(
                f"'{self.drive}' is nothing to compare with.",
                "drive",
                "Choose reference, instruments or estimate.",
            )
        if (self.drive == "instruments") != bool(self.driving):
            raise UserError(
                "the instruments to compare with are not clear.",
                "driving",
                "Name them together with drive: instruments, and only then.",
            )
        limits = {
            "block": (60.0, 600.0),
            "lead_in": (2.0, 60.0),
            "learning": (2, 1000),
            "false_alarms_per_day": (1e-4, 10.0),
            "wait": (0.0, 30.0),
        }
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(
                    f"{value:g} is out of range.", name, f"Give a value from {low:g} to {high:g}."
                )

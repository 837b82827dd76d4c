"""Options that have no effect without others, or beside others, are refused."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple

from wind_sensors.errors import UserError


class Rule(NamedTuple):
    """What must or must not stand beside an option whose default is None or False.

    Attributes:
        option: Like `--stability`.
        needs: At least one of these must be given too.
        excludes: None of these has an effect beside it.
    """

    option: str
    needs: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()


def obey(args: argparse.Namespace, rules: Sequence[Rule]) -> None:
    """Check what was given.

    Raises:
        UserError: A rule is broken; the first is told.
    """

    def given(option: str) -> bool:
        value = getattr(args, option.lstrip("-").replace("-", "_"))
        return value is not None and value is not False

    for rule in rules:
        if not given(rule.option):
            continue
        if rule.needs and not any(given(option) for option in rule.needs):
            needed = " or ".join(rule.needs)
            raise UserError(
                f"this has no effect without {needed}.", rule.option, "Add it, or leave this out."
            )
        for option in rule.excludes:
            if given(option):
                raise UserError(
                    f"this has no effect beside {rule.option}.", option, "Leave one of them out."
                )

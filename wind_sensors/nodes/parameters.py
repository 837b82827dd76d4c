"""One table of parameters for each node: declaration, validation and documentation in one place."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, TypeAlias

from wind_sensors.errors import UserError

if TYPE_CHECKING:
    from rclpy.node import Node

Value: TypeAlias = bool | int | float | str | tuple[float, ...] | None


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    Attributes:
        name: As in `--ros-args -p name:=value`.
        kind: bool, int, float, str, or tuple for an array of numbers. Whole numbers are accepted
            for float.
        default: None: the parameter stays unset until given.
        description: What it means, with its unit in brackets.
        minimum, maximum: Inclusive limits of a number.
        choices: Accepted words; empty: any.
        pattern: Regular expression of the accepted text; empty: any.
        changeable: Whether it can be set while the node runs.
    """

    name: str
    kind: type[bool] | type[int] | type[float] | type[str] | type[tuple[float, ...]]
    default: Value
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    pattern: str = ""
    changeable: bool = False

    def accept(self, value: object) -> Value:
        """The value in the parameter's own type.

        Args:
            value: What ROS delivered; None stands for unset.

        Raises:
            ValueError: With the reason, written for people.
        """
        if value is None:
            if self.default is None:
                return None
            raise ValueError(f"'{self.name}' cannot be unset")
        if self.kind is bool:
            if isinstance(value, bool):
                return value
            raise ValueError(f"'{self.name}' is true or false, not {value!r}")
        if self.kind is str:
            if isinstance(value, bool) and str(value).lower() in self.choices:
                # ROS reads the word `true` as a boolean before anybody can say that it is a word.
                value = str(value).lower()
            if not isinstance(value, str):
                raise ValueError(f"'{self.name}' is text, not {value!r}")
            if self.choices and value not in self.choices:
                raise ValueError(
                    f"'{self.name}' is one of {', '.join(self.choices)}, not '{value}'"
                )
            if self.pattern and not re.fullmatch(self.pattern, value):
                raise ValueError(f"'{self.name}' has the form {self.pattern}, not '{value}'")
            return value
        if self.kind is tuple:
            if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
                raise ValueError(f"'{self.name}' is an array of numbers, not {value!r}")
            return tuple(self._number(element) for element in value)
        number = self._number(value)
        if self.kind is int:
            if not isinstance(value, int):
                raise ValueError(f"'{self.name}' is a whole number, not {value!r}")
            return int(value)
        return number

    def _number(self, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"'{self.name}' is a number, not {value!r}")
        if not math.isfinite(value):
            raise ValueError(f"'{self.name}' must be finite, not {value}")
        if self.minimum is not None and value < self.minimum:
            raise ValueError(f"'{self.name}' must be at least {self.minimum:g}, not {value:g}")
        if self.maximum is not None and value > self.maximum:
            raise ValueError(f"'{self.name}' must be at most {self.maximum:g}, not {value:g}")
        return float(value)


def number(value: Value) -> float:
    """A value that is known to be a number.

    Raises:
        TypeError: It is not.
    """
    if not isinstance(value, (int, float)):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def declare(node: Node, table: Sequence[Parameter]) -> dict[str, Value]:
    """Declare a table's parameters and return their values, overrides included.

    Raises:
        UserError: An override has the wrong type or lies outside its limits.
    """
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    values: dict[str, Value] = {}
    for parameter in table:
        descriptor = ParameterDescriptor(
            description=parameter.description,
            read_only=not parameter.changeable,
            # Static typing would refuse `rate:=5` for a floating-point number.
            dynamic_typing=True,
            additional_constraints=(
                f"one of: {', '.join(parameter.choices)}"
                if parameter.choices
                else parameter.pattern
            ),
        )
        low, high = parameter.minimum, parameter.maximum
        if low is not None or high is not None:
            if parameter.kind is int:
                descriptor.integer_range = [
                    IntegerRange(
                        from_value=-(2**63) if low is None else int(low),
                        to_value=2**63 - 1 if high is None else int(high),
                    )
                ]
            elif parameter.kind is float:
                descriptor.floating_point_range = [
                    FloatingPointRange(
                        from_value=-math.inf if low is None else float(low),
                        to_value=math.inf if high is None else float(high),
                    )
                ]
        default = (
            list(parameter.default) if isinstance(parameter.default, tuple) else parameter.default
        )
        given = node.declare_parameter(parameter.name, default, descriptor, ignore_override=False)
        values[parameter.name] = _accepted(node, parameter, given.value)
    return values


def _accepted(node: Node, parameter: Parameter, value: object) -> Value:
    try:
        return parameter.accept(value)
    except ValueError as error:
        raise UserError(
            f"{error}.",
            where=f"parameters of {node.get_fully_qualified_name()}",
            remedy=f"It means: {parameter.description}",
        ) from error


def changed(
    table: Sequence[Parameter], values: Mapping[str, Value], requested: Mapping[str, object]
) -> dict[str, Value]:
    """The values after a change requested at run time.

    Args:
        table: The node's parameters.
        values: Their present values.
        requested: New raw values by name, None for one that is to be unset; names outside the
            table are ignored.

    Raises:
        ValueError: A requested value is not acceptable.
    """
    known = {parameter.name: parameter for parameter in table}
    for name in known.keys() & requested.keys():
        if requested[name] is None:
            # ROS would take away the parameter itself, and nothing could set it again.
            raise ValueError(f"'{name}' cannot be unset while the node runs; set a value")
    accepted = {name: known[name].accept(v) for name, v in requested.items() if name in known}
    return {**values, **accepted}


def unknown_parameters(node: Node, peers: Iterable[Node] = ()) -> dict[str, str]:
    """What was given to a node as a parameter although nobody declared it.

    Args:
        node: A node that has declared all its parameters.
        peers: Nodes of the same process; what one of them declares was meant for it.

    Returns:
        By name, the most similar declared name; empty where none is similar. Quality of service
        (`qos_overrides`) is left out: it is declared topic by topic as the graph is discovered.
    """
    # rclpy has no public way to ask for values of parameters that are not declared.
    given: Mapping[str, object] = getattr(node, "_parameter_overrides", {})
    known = list(node.get_parameters_by_prefix(""))
    names = [
        name
        for name in sorted(given)
        if not name.startswith("qos_overrides.")
        and not any(one.has_parameter(name) for one in (node, *peers))
    ]
    return {name: next(iter(get_close_matches(name, known, n=1, cutoff=0.7)), "") for name in names}


def unknown_text(name: str, nearest: str) -> str:
    """A sentence about a parameter from `unknown_parameters`."""
    hint = f": did you mean '{nearest}'?" if nearest else "."
    return f"The parameter '{name}' is not known and has no effect{hint}"


def describe(table: Sequence[Parameter]) -> str:
    """The table as text for `--help`: name, type, default, limits, meaning."""
    lines = []
    for parameter in table:
        kind = "numbers" if parameter.kind is tuple else parameter.kind.__name__
        facts = [kind]
        if parameter.default is not None and parameter.default != "":
            shown = (
                str(parameter.default).lower() if parameter.kind is bool else str(parameter.default)
            )
            facts.append(f"default {shown}")
        if parameter.choices:
            facts.append(" | ".join(word for word in parameter.choices if word))
        if parameter.pattern:
            facts.append(parameter.pattern)
        if parameter.minimum is not None or parameter.maximum is not None:
            low = "" if parameter.minimum is None else f"{parameter.minimum:g}"
            high = "" if parameter.maximum is None else f"{parameter.maximum:g}"
            facts.append(f"{low}..{high}")
        if parameter.changeable:
            facts.append("changeable")
        lines.append(f"  {parameter.name} ({', '.join(facts)})")
        lines.append(f"      {parameter.description}")
    return "\n".join(lines)

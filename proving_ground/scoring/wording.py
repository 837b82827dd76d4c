"""Verdicts and answers in words."""

from __future__ import annotations

from typing import Any

DAY = 86400.0


def verdict_line(diagnosis: dict[str, Any]) -> str:
    """A verdict with its findings in one line; times of more than a day in days."""
    parts = []
    for finding in diagnosis.get("findings", []):
        values = [
            f"{name} {_estimate(p)}"
            for name, p in finding.get("parameters", {}).items()
            if None not in (p.get("value"), p.get("low"), p.get("high"))
        ]
        known = f" [{'; '.join(values)}]" if values else ""
        parts.append(f"{finding['effect']} ({finding.get('instrument', '')}){known}")
    text = str(diagnosis["verdict"])
    return f"{text}: {', '.join(parts)}" if parts else text


def _estimate(parameter: dict[str, Any]) -> str:
    value, low, high = (float(parameter[key]) for key in ("value", "low", "high"))
    unit = str(parameter.get("unit", ""))
    digits = ".3g"
    if unit == "s" and abs(value) >= DAY:
        value, low, high, unit, digits = value / DAY, low / DAY, high / DAY, "d", ".2f"
    interval = f"{low:{digits}} to {high:{digits}}"
    return f"{value:{digits}} ({interval}){'' if unit == '1' else ' ' + unit}"


def answer_line(cause: dict[str, Any]) -> str:
    """A concealed cause in one line: where, how large, with which numbers."""
    name = cause.get("stranger", cause["effect"])
    rest = {
        key.replace("_", " "): value
        for key, value in cause.items()
        if key not in ("effect", "instrument", "size_factor", "stranger")
    }
    numbers = ", ".join(f"{key} {value}" for key, value in rest.items())
    size = f"{float(cause['size_factor']):g} times the smallest size worth reporting"
    return f"{name} ({cause['instrument']}), {size}" + (f": {numbers}" if numbers else "")

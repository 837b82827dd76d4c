"""Figures of a page, each in a wide cut for a desk and a narrow one for a phone."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Callable
from html import escape

from matplotlib.figure import Figure

from wind_sensors.report.style import house

WIDE = 9.6
NARROW = 4.4
"""Widths of the cuts [inch]; what is drawn for the latter is read on a phone without scrolling."""

CUTS_STYLE = """
figure{margin:.6rem 0 .4rem}svg{display:block;width:100%;height:auto}
svg text{font-family:system-ui,-apple-system,"Segoe UI",sans-serif!important}
.narrow{display:none}@media(max-width:640px){.wide{display:none}.narrow{display:block}}
"""
"""Rules of a page that holds figures in two cuts."""

SCROLL_STYLE = """
.scroll{overflow-x:auto;background:
linear-gradient(90deg,#fff 40%,#fff0) local,
linear-gradient(270deg,#fff 40%,#fff0) 100% 0 local,
linear-gradient(90deg,#22303c40,#22303c00),
linear-gradient(270deg,#22303c40,#22303c00) 100% 0;
background-size:3rem 100%,3rem 100%,.8rem 100%,.8rem 100%;background-repeat:no-repeat}
@media(max-width:30rem){.scroll table{font-size:.8rem}.scroll th,.scroll td{padding:.3rem .25rem}
.scroll th.n,.scroll td.n{white-space:normal}}
"""
"""Rules of tables in a `scroll` block: a shadow lies on the side where more of it is hidden."""

_NARROW_TITLE = 36
_NARROW_LABEL = 22
"""So many letters of a title fit above a narrow figure, and of a label beside one."""


def is_narrow(width: float) -> bool:
    """Whether a figure of this width [inch] is the narrow cut."""
    return width < 0.5 * (NARROW + WIDE)


def title_for(width: float, text: str) -> str:
    """A title in as many lines as the cut needs."""
    return textwrap.fill(text, _NARROW_TITLE) if is_narrow(width) else text


def label_for(width: float, text: str) -> str:
    """What stands beside an axis, in as many lines as the cut needs."""
    return textwrap.fill(text, _NARROW_LABEL) if is_narrow(width) else text


def in_both_cuts(draw: Callable[[float], Figure | None], label: str) -> str:
    """A figure of a page, of whose two cuts the one that fits is seen.

    Args:
        draw: Makes the figure for a width [inch]; None: there is nothing to show.
        label: What it shows, for those who do not see it; no two figures of a page have the same.

    Returns:
        Empty if there is nothing to show.
    """
    cuts = ""
    for name, width in (("wide", WIDE), ("narrow", NARROW)):
        made = draw(width)
        if made is None:
            return ""
        cuts += f"<div class='{name}'>{_svg(made, f'{name}-{_mark(label)}')}</div>"
    return f"<figure role='img' aria-label='{escape(label, quote=True)}'>{cuts}</figure>"


def _mark(label: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", label.lower())


def _svg(made: Figure, mark: str) -> str:
    """A figure as an SVG element; identifiers must differ between the figures of one page."""
    stream = io.StringIO()
    with house():
        made.savefig(stream, format="svg", metadata={"Date": None}, transparent=True)
    text = stream.getvalue()
    text = re.sub(r'id="([^"]+)"', rf'id="{mark}-\1"', text)
    text = re.sub(r'(xlink:href="#|url\(#)', rf"\1{mark}-", text)
    return text[text.index("<svg") :]

"""Fill a page with the numbers of a scoring run: one command, nothing typed by hand."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from proving_ground.publishing.blocks import EARLIER, FILES, blocks, cards_of, together
from proving_ground.scoring.card import NUMBERS, read_card
from proving_ground.scoring.figures import draw_confusion, draw_doses, draw_rates
from wind_sensors.errors import UserError

BLOCK = re.compile(r"(<!-- numbers: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def publish(page: Path, sources: Sequence[Path]) -> list[Path]:
    """Take over the numbers of some folders, draw the figures and fill the page; what was written.

    The numbers are kept in a folder beside the page that is called like it, figures in `figures`.
    The scores of another set that stood there before are kept as an earlier version's.

    Raises UserError if there is no page, if a folder holds no numbers, or if the page asks for a
    part that does not exist.
    """
    if not page.is_file():
        raise UserError("there is no page to fill", str(page), "Name it with --page.")
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    for source in sources:
        _take_over(source, folder)
    text = filled(page.read_text(encoding="utf-8"), blocks(folder), str(page))
    page.write_text(text, encoding="utf-8")
    return [page, *_draw(folder, page.parent / "figures")]


def filled(text: str, parts: dict[str, str], where: str) -> str:
    """The text with every marked part replaced.

    Raises UserError if a part is unknown.
    """
    unknown = sorted({name for _, name, _ in BLOCK.findall(text)} - set(parts))
    if unknown:
        raise UserError(
            f"the page asks for {', '.join(unknown)}",
            where,
            f"There are {', '.join(sorted(parts))}.",
        )
    return BLOCK.sub(lambda found: found[1] + parts[found[2]] + "\n" + found[3], text)


def _take_over(source: Path, folder: Path) -> None:
    found = [source / name for name in FILES if (source / name).is_file()]
    if not found:
        raise UserError(
            "there are no numbers",
            str(source),
            f"Name folders with {', '.join(FILES)}: `open`, `peers` and `real` write them.",
        )
    for path in found:
        target = folder / path.name
        if path.name == NUMBERS and target.is_file():
            _keep_earlier(target, path)
        shutil.copyfile(path, target)


def _keep_earlier(before: Path, now: Path) -> None:
    old, new = read_card(before).about, read_card(now).about
    if old.get("commitment") != new.get("commitment"):
        kept = before.parent / EARLIER
        kept.mkdir(exist_ok=True)
        number = len(list(kept.glob("*.json"))) + 1
        shutil.copyfile(before, kept / f"{number:02d}_{old.get('version', 'unnamed')}.json")


def _draw(folder: Path, figures: Path) -> list[Path]:
    cards = cards_of(folder)
    if not (folder / NUMBERS).is_file():
        return []
    newest, pooled = cards[-1][1], together(cards)
    figures.mkdir(exist_ok=True)
    drawn = [figures / "proof_rates.png", figures / "proof_confusion.png"]
    draw_rates(newest.rates, drawn[0], pooled.rates)
    draw_confusion(pooled.judged, drawn[1])
    if pooled.doses:
        drawn.append(figures / "proof_doses.png")
        draw_doses(pooled.doses, drawn[2])
    return drawn

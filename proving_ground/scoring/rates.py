"""Rates with their Clopper-Pearson intervals, against what was promised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from scipy.stats import beta

from proving_ground.scoring.outcome import NAMES_SOMETHING, UNKNOWN, Judged

LARGE = 3.0
SINGLE = ("single", "onset", "large")


@dataclass(frozen=True)
class Rate:
    """k of n, with the interval of the rate at 95 %, and what was promised."""

    title: str
    hits: int
    total: int
    promised: str
    at_least: float | None = None
    at_most: float | None = None

    @property
    def value(self) -> float:
        """The rate [1]; not a number where there was no case."""
        return self.hits / self.total if self.total else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper-Pearson interval of the rate at 95 %."""
        return clopper_pearson(self.hits, self.total)

    @property
    def met(self) -> bool | None:
        """Whether the promise is kept by the rate itself; None where there was no case."""
        if not self.total:
            return None
        above = self.at_least is None or self.value >= self.at_least
        below = self.at_most is None or self.value <= self.at_most
        return above and below


def clopper_pearson(hits: int, total: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of a rate (Clopper and Pearson, 1934)."""
    if total == 0:
        return 0.0, 1.0
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, total - hits + 1))
    high = 1.0 if hits == total else float(beta.ppf(1.0 - tail, hits + 1, total - hits))
    return low, high


def rate(
    title: str,
    judged: Sequence[Judged],
    among: Callable[[Judged], bool],
    hit: Callable[[Judged], bool],
    promised: str,
    *,
    at_least: float | None = None,
    at_most: float | None = None,
) -> Rate:
    """How often `hit` among the recordings that `among` picks."""
    picked = [j for j in judged if among(j)]
    return Rate(title, sum(hit(j) for j in picked), len(picked), promised, at_least, at_most)


def _known(judged: Judged) -> bool:
    return bool(judged.truth) and UNKNOWN not in judged.truth


def _names(judged: Judged) -> bool:
    return judged.outcome in NAMES_SOMETHING


def _pair(judged: Judged) -> bool:
    return len(judged.truth) == 2 and judged.size >= LARGE and _known(judged)


def _single(judged: Judged) -> bool:
    return judged.stratum in SINGLE and judged.size >= LARGE


def open_minded(judged: Judged) -> bool:
    """Whether a diagnosis says that something is wrong without claiming what."""
    return not judged.named and judged.verdict in ("unknown", "ambiguous")


def promised_rates(judged: Sequence[Judged]) -> list[Rate]:
    """The rates that the product promises, in the order of the promise."""
    holds = [c.holds for j in judged for c in j.coverage]
    removed = [j.excess_removed for j in judged if j.excess_removed is not None]
    return [
        rate(
            "a name in a healthy recording",
            judged,
            lambda j: j.stratum == "healthy",
            _names,
            "at most 5 %",
            at_most=0.05,
        ),
        rate(
            "the exact effect, single, three times the minimum or more",
            judged,
            _single,
            lambda j: j.outcome == "exact",
            "at least 90 %",
            at_least=0.90,
        ),
        rate(
            "both effects of a pair, exactly",
            judged,
            _pair,
            lambda j: j.outcome == "exact",
            "at least 75 %",
            at_least=0.75,
        ),
        rate(
            "the truth named or in the set, where something was named, at that size",
            judged,
            lambda j: _known(j) and j.size >= LARGE and _names(j),
            lambda j: j.found,
            "at least 97 %",
            at_least=0.97,
        ),
        rate(
            "a confident wrong name, all recordings",
            judged,
            lambda j: True,
            lambda j: j.outcome == "wrong name" or (UNKNOWN in j.truth and bool(j.named)),
            "at most 3 %",
            at_most=0.03,
        ),
        rate(
            "unknown physics flagged as unknown",
            judged,
            lambda j: j.stratum == "unknown",
            lambda j: j.verdict == "unknown",
            "at least 90 %",
            at_least=0.90,
        ),
        rate(
            "unknown physics given a name of the catalogue",
            judged,
            lambda j: j.stratum == "unknown",
            _names,
            "at most 5 %",
            at_most=0.05,
        ),
        rate(
            "an effect taken out of the catalogue: unknown, or alternatives without a claim",
            judged,
            lambda j: j.stratum == "withheld",
            open_minded,
            "at least 90 %",
            at_least=0.90,
        ),
        rate(
            "an effect taken out of the catalogue given another name",
            judged,
            lambda j: j.stratum == "withheld",
            lambda j: bool(j.named),
            "at most 5 %",
            at_most=0.05,
        ),
        Rate(
            "95 % intervals that hold the truth", sum(holds), len(holds), "92 to 97 %", 0.92, 0.97
        ),
        Rate(
            "at least 80 % of the excess removed on held-out data, exact findings",
            sum(r >= 0.8 for r in removed),
            len(removed),
            "every one",
            at_least=1.0,
        ),
        rate(
            "under 30 s",
            judged,
            lambda j: j.verdict not in ("failed", "refused"),
            lambda j: j.seconds < 30.0,
            "every one",
            at_least=1.0,
        ),
        rate(
            "a name where there is too little wind or record to tell",
            judged,
            lambda j: j.stratum == "too_little",
            lambda j: _names(j) and not j.found,
            "(no promise)",
        ),
        rate(
            "a diagnosis that failed",
            judged,
            lambda j: True,
            lambda j: j.outcome == "failed",
            "none",
            at_most=0.0,
        ),
    ]


def median_seconds(judged: Sequence[Judged]) -> tuple[float, float]:
    """Median run time [s], on the clock and of processors, of the diagnoses that ended."""
    ended = [j for j in judged if j.verdict not in ("failed", "refused")]
    if not ended:
        return float("nan"), float("nan")
    return median(j.seconds for j in ended), median(j.processor for j in ended)


def mean_set_size(judged: Sequence[Judged]) -> float:
    """Mean number of names offered for a finding, where an effect of the catalogue was planted."""
    sizes = [j.set_size for j in judged if _known(j) and _names(j) and j.set_size > 0]
    return sum(sizes) / len(sizes) if sizes else float("nan")

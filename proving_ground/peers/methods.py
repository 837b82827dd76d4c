"""Sparse regression and forward selection: from a residual and signatures to coefficients.

Each method takes scaled signatures (n, m) and a scaled residual (n) and returns m coefficients,
zero for what it leaves out. The libraries are optional and imported where they are used.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from proving_ground.inflow import Array
from wind_sensors.errors import UserError

Method = Callable[[Array, Array], Array]
NEEDED = ("pysindy", "sysidentpy", "sklearn")
MOST_TERMS = 8
MODELS = 12


def require_peers() -> None:
    """Raise UserError if one of the optional libraries is missing."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise UserError(
            f"the libraries to compare with are not installed ({', '.join(missing)})",
            "",
            "`pip install '.[peers]'` installs them.",
        )


def least_squares(signatures: Array, residual: Array, chosen: list[int]) -> Array:
    """Ordinary least squares over the chosen columns, zero elsewhere."""
    coefficients = np.zeros(signatures.shape[1])
    if chosen:
        found = np.linalg.lstsq(signatures[:, chosen], residual, rcond=None)[0]
        coefficients[chosen] = found
    return coefficients


def forward_bic(signatures: Array, residual: Array) -> Array:
    """Forward selection, a column at a time, for as long as the BIC falls."""
    count = residual.size
    chosen: list[int] = []
    best = count * np.log(np.mean(residual**2))
    while len(chosen) < MOST_TERMS:
        left = residual - signatures @ least_squares(signatures, residual, chosen)
        gain = np.abs(signatures.T @ left)
        gain[chosen] = 0.0
        trial = [*chosen, int(np.argmax(gain))]
        rest = residual - signatures @ least_squares(signatures, residual, trial)
        score = count * np.log(np.mean(rest**2)) + len(trial) * np.log(count)
        if score >= best:
            break
        best, chosen = score, trial
    return least_squares(signatures, residual, chosen)


def lasso(signatures: Array, residual: Array) -> Array:
    """LASSO with its penalty from five-fold cross-validation over blocks of time."""
    from sklearn.linear_model import LassoCV
    from sklearn.model_selection import KFold

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = LassoCV(cv=KFold(5), fit_intercept=False, max_iter=3000)
        model.fit(signatures, residual)
    return np.asarray(model.coef_)


def _sindy(optimizer: Any, signatures: Array, residual: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fitted = optimizer.fit(signatures, residual[:, None])
    return np.asarray(fitted.coef_).reshape(-1)


def stlsq(signatures: Array, residual: Array, threshold: float = 0.05) -> Array:
    """Sequentially thresholded least squares of pysindy."""
    import pysindy

    return _sindy(pysindy.STLSQ(threshold=threshold, alpha=0.05), signatures, residual)


def sr3(signatures: Array, residual: Array, weight: float = 0.005) -> Array:
    """Sparse relaxed regularised regression of pysindy."""
    import pysindy

    optimizer = pysindy.SR3(reg_weight_lam=weight, regularizer="L0", relax_coeff_nu=1.0)
    return _sindy(optimizer, signatures, residual)


def ensemble(signatures: Array, residual: Array, threshold: float = 0.05) -> Array:
    """Bagged STLSQ: the median of models of pysindy on resampled rows."""
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(MODELS):
        rows = rng.integers(0, residual.size, residual.size)
        drawn.append(stlsq(signatures[rows], residual[rows], threshold))
    return np.asarray(np.median(drawn, axis=0))


def frols(signatures: Array, residual: Array) -> Array:
    """Forward regression with orthogonal least squares of sysidentpy, terms by its own AIC."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    model = FROLS(
        order_selection=False,
        n_terms=MOST_TERMS,
        basis_function=Polynomial(degree=1),
        model_type="NFIR",
    )
    model.max_lag = 0
    ranked = model.error_reduction_ratio(signatures, residual[:, None], MOST_TERMS)[1]
    order = [int(i) for i in np.asarray(ranked).ravel()[:MOST_TERMS]]
    count = residual.size
    scores = []
    for terms in range(len(order) + 1):
        rest = residual - signatures @ least_squares(signatures, residual, order[:terms])
        scores.append(count * np.log(np.mean(rest**2)) + 2.0 * terms)
    return least_squares(signatures, residual, order[: int(np.argmin(scores))])


METHODS: dict[str, tuple[Method, ...]] = {
    "STLSQ (pysindy)": (stlsq, partial(stlsq, threshold=0.2)),
    "ensemble STLSQ (pysindy)": (ensemble, partial(ensemble, threshold=0.2)),
    "SR3 (pysindy)": (sr3, partial(sr3, weight=0.05)),
    "FROLS (sysidentpy)": (frols,),
    "LASSO, cross-validated (scikit-learn)": (lasso,),
    "forward selection by BIC": (forward_bic,),
}
"""Every method with its settings; it is judged by the setting that suits it best."""

"""What a finding removes from the misfit of blocks that were not fitted, for people."""

from __future__ import annotations

from wind_sensors.diagnosis.proving.proof import Proof


def removed_text(proof: Proof) -> str:
    """The share with its interval, what it is a share of, and the residuals behind it.

    Args:
        proof: Of a diagnosis without a measured reference. Where its floor is 0 the share is one of
            the whole misfit.
    """
    share = (
        f"{100.0 * proof.excess_removed:.0f} % "
        f"({100.0 * proof.low:.0f} to {100.0 * proof.high:.0f} %)"
    )
    residual = f"residual {proof.before:.2f} before, {proof.after:.2f} after"
    if proof.floor > 0.0:
        return (
            f"{share} of the excess misfit, which is what a function of direction and speed could "
            f"remove; {residual}, floor {proof.floor:.2f}, in units of its noise"
        )
    return f"{share} of the whole misfit; {residual}, in units of its noise"

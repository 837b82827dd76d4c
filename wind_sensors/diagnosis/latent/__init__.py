"""Moving platforms without a reference: the earth wind itself is unknown, but changes slowly.

`headings` makes of a recording the apparent wind and the residual of a station in the slowly
changing wind that fits it best, as a bench of `means`; `diagnose` searches it as means are.
"""

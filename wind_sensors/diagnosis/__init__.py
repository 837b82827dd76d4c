"""Recorded minus simulated: the physics that was left out.

`verdict.diagnose` leads through the rooms in this order:

- `comparing`: a recording beside the simulation of its station;
- `healthy`: what is normal, learnt from healthy recordings;
- `regions`: where a mismatch sits;
- `effects`: the catalogue, and `explaining`: from a mismatch to effects that explain it;
- `proving`: whether data that were not fitted bear that out, and what is said.

Other references have rooms of their own, with the same verdicts: `means` (ten-minute records),
`latent` (the earth wind behind a moving platform) and `watch` (live).
"""

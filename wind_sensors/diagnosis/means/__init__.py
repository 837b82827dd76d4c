"""Recordings of means: the instruments of a mast against each other.

`diagnose.diagnose_means` leads through the modules in this order:

- `averages`: the means as columns; `silences`: sensors that stand still, and ice; `healthy`: what
  is normal;
- `pair` and `vanes`: who is compared with whom, with `mean_response` as the simulation;
- `bench`: either as rows with noise and blocks, all that a search knows of them;
- `search`: from `screening` of templates (`pair_effects`) to terms that `fits` on every other block
  prove on the others; `culprit`: on which rotor of a pair;
- `findings`, with `proofs` and `detectable`: what is said; `corrected`: what is corrected;
  `panels`: what is shown.

A cost is Huber's, summed over the rows of a block; all decisions are about such sums on blocks that
were not fitted, for neighbouring means share their weather and are no independent evidence.
"""

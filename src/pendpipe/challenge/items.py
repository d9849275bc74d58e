"""Make one item: a recording and the truth about it, with the oracle's figures.

random = np.random.default_rng(1)
item = make_single(random, "cubic-stiffness", 100.0)
write_recording("recording.csv", item.scenario, item.codes)
item.truth["effects"][0]["delta_chi2"], item.truth["oracle"]["class"]
"""

from pendpipe.challenge.item import Item
from pendpipe.challenge.pairs import make_pair
from pendpipe.challenge.singles import make_null, make_single
from pendpipe.challenge.strangers import make_outside, outside_names

__all__ = ["Item", "make_null", "make_outside", "make_pair", "make_single", "outside_names"]

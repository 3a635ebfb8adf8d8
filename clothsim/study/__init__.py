"""Studies: the error of a run and its cost, data sets of drapes, models learned from them."""

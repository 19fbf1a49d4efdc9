"""Figures of the nine-hinge stage alone: Figs. 2 to 7 and 11 of the paper, its drive and its poses."""

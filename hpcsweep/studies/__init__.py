"""Studies: the runs of a campaign, their order, their results."""

"""What a campaign computes: its runs, their order, their results."""

"""All attractors at each point, with their shares."""

"""Find all attractors at each point, with their shares."""

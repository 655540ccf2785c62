"""The march: make a step, find its guard, observe, pass the guard, go on; periods and records."""

"""Run jobs on ranks into one file each: costs, progress, history."""

"""A job run on ranks into one file: its costs, its progress, its history."""

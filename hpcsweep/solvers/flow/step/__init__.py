"""A step of smooth motion: by a table, in modes, as a series, by stages; its rows and bounds."""

"""Guards: what ends a step, with a proof that none is stepped over; modes of elements."""

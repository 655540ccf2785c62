"""The first contact that reaches its layer, with a proof that none is stepped over."""

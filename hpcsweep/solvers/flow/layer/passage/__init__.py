"""Passages of a contact layer in closed form, and their tangent maps."""

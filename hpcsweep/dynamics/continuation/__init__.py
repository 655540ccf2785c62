"""Numerical continuation of periodic orbits of any map: branches, special points, switching."""

"""Motions of elements: modes, guards that end them, contacts with dashpots, sliders, layers."""

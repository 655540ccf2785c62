"""Motions of sharp elements: modes, guards that end them, contacts with dashpots and sliders."""

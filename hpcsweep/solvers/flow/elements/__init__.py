"""Motions with dashpots: contacts that are past their stops, those that push, and their changes."""

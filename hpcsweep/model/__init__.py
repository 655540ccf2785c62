"""Structures, their contact law and their equations of motion."""

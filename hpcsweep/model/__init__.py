"""Structures, their contact law and their equations of motion."""

KERNELS = (
    "backbone.py",
    "contact.py",
    "degrading.py",
    "elements.py",
    "equations.py",
    "kernel_contacts.py",
    "kernel_model.py",
    "observed.py",
)
"""Files that define kernels and the constants in them (`hpcsweep.kernels.compile.cache`)."""

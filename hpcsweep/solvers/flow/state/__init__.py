"""Data of the kernels: states, tables, workspaces, and how they are passed."""

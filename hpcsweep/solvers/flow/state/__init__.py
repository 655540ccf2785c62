"""What the kernels work on: states, tables, workspaces, and how they are handed over."""

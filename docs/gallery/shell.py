"""Run a command as in a terminal, for the examples."""

import subprocess


def shell(command: str) -> None:
    """Print a command and what it prints; stop where it fails."""
    print(f"$ {command}")
    done = subprocess.run(command, shell=True, check=True, capture_output=True, text=True)
    print(done.stdout, end="")

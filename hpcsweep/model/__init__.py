"""The structure, its contact law and its equations of motion."""

"""A job: what a user wrote, validated."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hpcsweep.job.fingerprint import fingerprint


class JobError(ValueError):
    """A job that cannot be run; the message is one line for the user."""


@dataclass(frozen=True, eq=False)
class Job:
    """A validated job.

    Attributes
    ----------
    name : str
        Default name of the results.
    text : str
        The TOML text.
    study : Study
        What it computes.
    notes : tuple of str
        What was done with the text that a user should know, a line each.
    """

    name: str
    text: str
    study: Any
    notes: tuple[str, ...] = ()

    @property
    def structure(self) -> Any:
        """The structure of the study."""
        return self.study.structure

    @property
    def settings(self) -> Any:
        """The settings of the study's runs."""
        return self.study.settings

    @cached_property
    def fingerprint(self) -> str:
        """Hash of what the job means, whatever its text looks like and its name is."""
        return fingerprint(self.study)

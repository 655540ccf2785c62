"""A validated job."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from hpcsweep.job.fingerprint import fingerprint
from hpcsweep.model.arguments import InputError
from hpcsweep.model.structure import Structure
from hpcsweep.studies.refine.growth import MapGrowth
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.study import Study

ABOUT = ("title", "institution", "license")
"""Keys of a job that only tell about its results, and attributes of the file."""


class JobError(InputError):
    """Raised for a job that cannot be run; the message is one line for the user.

    Attributes
    ----------
    line : str
        Of a file of rows, where it is about one: "line 2".
    """

    line = ""


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
        Study that the job computes.
    notes : tuple of str
        Messages for the user about changes made to the text, a line each.
    about : mapping of str to str
        Attributes of the file that the job gives, of `ABOUT`.
    """

    name: str
    text: str
    study: Study
    notes: tuple[str, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """Structure of the study."""
        return self.study.structure

    @property
    def settings(self) -> SweepSettings:
        """Settings of the study's runs."""
        return self.study.settings

    @cached_property
    def growth(self) -> MapGrowth | None:
        """How results refine the study; None if all its runs are computed."""
        refine = self.study.refine
        return None if refine is None else MapGrowth(self.study, refine)

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the meaning of the job, independent of its name and the form of its text."""
        return fingerprint(self.study)

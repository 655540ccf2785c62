"""Dashpots in job files: what is read, what is refused, what it means."""

import tomllib

import pytest
from together import together

from hpcsweep.job import JobError, parse_job
from hpcsweep.job.structures import read_structure
from hpcsweep.job.values import Values

SWEEP = "\n[sweep]\nomega = 0.5\namplitude = 0.1\n"
SHORT = "[structure]\nn_floors = 2\nsharpness = inf\nrestitution = 0.65\ntension = true\n"
MATRICES = """
[structure.matrices]
mass = [1.0]
stiffness = [[1.0]]

[[structure.contact]]
direction = [1.0]
gap = 0.1
stiffness = 50.0
damping = 1.5
tension = true
"""
POUNDING = """
[[building]]
mass = [1.0, 1.0]
storey_stiffness = 1.0

[[building]]
mass = [2.0, 2.0]
storey_stiffness = 1.0

[pounding]
gap = 0.1
stiffness = 50.0
restitution = [0.65, 0.8]
"""
OF = {"short": SHORT, "matrices": MATRICES, "pounding": POUNDING}


def job(text):
    return parse_job(text + SWEEP, "job.toml", "job")


def read(text):
    return read_structure(Values("job.toml", tomllib.loads(text)))


@together("form", OF)
def test_a_job_with_dashpots_is_read_and_left_to_flow(form):
    assert job(OF[form]).study.structure.contact_damping.min() > 0
    with pytest.raises(JobError, match=r"solver\.method = 'bdf': must be 'flow' where contacts"):
        job(f'{OF[form]}\n[solver]\nmethod = "bdf"\n')


@together(
    "form, damping, tension",
    [
        ("short", [8.5919864, 8.5919864], True),
        ("matrices", [1.5], True),
        ("pounding", [1.7313437, 0.8585787], False),
    ],
)
def test_dashpots_are_read(form, damping, tension):
    structure = read(OF[form])
    assert structure.contact_damping == pytest.approx(damping, rel=1e-6)
    assert all(contact.tension == tension for contact in structure.contacts)


@together(
    "form, old, new, said",
    [
        ("short", "0.65", "0.0", "job.toml: structure.restitution must be from 1e-06 to 1"),
        ("short", "0.65", "[0.5]", "job.toml: structure.restitution must have 2 numbers"),
        ("short", "true", "1", "job.toml: structure.tension must be true or false, is 1"),
        ("short", "= inf", "= 1e4", "structure.restitution = 0.65 needs sharpness = inf"),
        ("matrices", "1.5", "-1.5", r"job.toml: structure.contact\[0\].damping must be at least 0"),
        ("matrices", "1.5", "1e40", r"structure.contact\[0\].damping = 1e.40"),
        ("matrices", "1.5", '"x"', r"job.toml: structure.contact\[0\].damping must be a number"),
        ("pounding", "0.8", "1.8", "job.toml: pounding.restitution must be from 1e-06 to 1"),
        ("pounding", "[0.65, 0.8]", "[0.5]", "job.toml: pounding.restitution must have 2 numbers"),
        ("pounding", "restit", "damping = 1\nrestit", "pounding.damping must not be given both"),
        ("pounding", "restit", "tension = 2\nrestit", "tension must be true or false"),
        ("pounding", "restit", "sharpness = 9\nrestit", "needs sharpness = inf"),
    ],
)
def test_what_is_wrong_is_one_line_that_names_file_key_and_rule(form, old, new, said):
    with pytest.raises(JobError, match=said) as refused:
        read(OF[form].replace(old, new))
    assert "\n" not in str(refused.value)


def test_a_job_without_dashpots_keeps_the_fingerprint_it_had_before_there_were_any():
    without = MATRICES.replace("damping = 1.5\ntension = true", "")
    assert job(without).fingerprint == BEFORE
    assert job(without + "damping = 0.0\ntension = false\n").fingerprint == BEFORE


BEFORE = "95c56994a5c2c228566c76b9a884b770873b0b59ac5b3a6a6582cad9f22311a6"

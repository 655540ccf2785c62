"""Backbones: what is read of them, in Python and in jobs, and what is refused."""

import numpy as np
import pytest

import hpcsweep
from hpcsweep.job import JobError, parse_job
from hpcsweep.solvers.offers import HARMONIC

JOB = """
[study]
kind = "records"

[[building]]
mass = [2.0, 1.0]
storey_stiffness = [300.0, 200.0]
yield_drift = 0.02
hardening = [0.03, 0.0]
collapse_drift = 0.5

[building.backbone]
rule = "pinching"
theta_p = [0.05, 0.06]
theta_pc = 0.2
Lambda = 1.5
kappa_f = 0.3
kappa_d = 0.5

[records]
synthetic = {count = 1, seed = 1, duration = 5.0}
scale = {from = 1.0, to = 2.0, count = 2}
"""
SLIDER = """
[study]
kind = "records"

[structure]
matrices = {mass = [1.0], stiffness = [[1.0]]}
collapse_drift = 5.0

[[structure.slider]]
direction = [1.0]
stiffness = 1.0
strength = 1.0
backbone = {theta_p = 1.0, theta_pc = 2.0, theta_u = 4.0}

[records]
synthetic = {count = 1, seed = 1, duration = 5.0}
scale = {from = 1.0, to = 2.0, count = 2}
"""


def read(text):
    return parse_job(text, "job.toml", "job")


def test_storeys_have_a_backbone_each_with_the_hardening_of_the_building():
    first, second = read(JOB).study.structure.sliders
    common = {"theta_pc": 0.2, "rule": "pinching", "Lambda": 1.5, "kappa_f": 0.3, "kappa_d": 0.5}
    assert first.backbone == hpcsweep.Backbone(0.05, hardening=0.03, **common)
    assert second.backbone == hpcsweep.Backbone(0.06, **common)
    # the whole storey is a slider: no elastic spring beside carries what it loses
    assert (first.stiffness, first.strength) == (300.0, 6.0)
    assert not read(JOB).study.structure.elastic_stiffness.any()


def test_a_slider_of_matrices_has_one_and_softens_by_its_falling_branch():
    (slider,) = read(SLIDER).study.structure.sliders
    assert slider.backbone == hpcsweep.Backbone(1.0, 2.0, 4.0)
    assert slider.softest == -0.5
    assert slider.path([1.0, 2.0, 3.0, 3.9, 4.1, 0.0]) == pytest.approx([1, 1, 0.5, 0.05, 0, 0])


@pytest.mark.parametrize(
    ("job", "old", "new", "said"),
    [
        (JOB, "theta_pc = 0.2\n", "", r"building\[0\].backbone.theta_pc is missing"),
        (
            JOB,
            "theta_pc = 0.2",
            "theta_pc = 0",
            r"building\[0\].backbone.theta_pc must be above 0, is 0",
        ),
        (
            JOB,
            "[0.05, 0.06]",
            "[0.05]",
            r"backbone.theta_p must have 2 numbers, one per storey, has 1",
        ),
        (
            JOB,
            '"pinching"',
            '"clough"',
            r"backbone.rule must be one of bilinear, peak-oriented, pinch",
        ),
        (JOB, '"pinching"', '"bilinear"', r"backbone.kappa_f goes with pinching"),
        (JOB, "kappa_d = 0.5\n", "", r"backbone.kappa_d is missing: pinching needs it"),
        (JOB, "Lambda = 1.5", "lambda = 1.5", r"backbone must not have 'lambda'"),
        (JOB, "yield_drift = 0.02", "", r"hardening goes with yield_force or yield_drift"),
        (JOB, "collapse_drift = 0.5", "", r"collapse_drift is missing: the structure softens"),
        (
            JOB,
            "hardening = [0.03, 0.0]",
            "hardening = -0.05",
            r"backbone.hardening must be from 0 to",
        ),
        (
            JOB,
            "hardening = [0.03, 0.0]",
            "flag_height = 0.5",
            r"flag_height and backbone must not be",
        ),
        (
            SLIDER,
            "theta_u = 4.0",
            "theta_u = 0.5",
            r"theta_u must be above the elongation at which it",
        ),
        (
            SLIDER,
            "strength = 1.0",
            "strength = 1.0\nkinetic = 0.5",
            r"kinetic and backbone must not",
        ),
    ],
)
def test_what_is_wrong_is_refused_in_one_line(job, old, new, said):
    assert old in job
    with pytest.raises(JobError, match=said) as caught:
        read(job.replace(old, new))
    assert "\n" not in str(caught.value)


def test_harmonic_motions_of_what_degrades_are_refused():
    structure = read(SLIDER).study.structure
    with pytest.raises(ValueError, match="without sliders that slip back or degrade: flag_height,"):
        HARMONIC.demand(structure)
    with pytest.raises(JobError, match="backbone"):
        read(SLIDER[: SLIDER.index("[records]")].replace('"records"', '"points"'))


def test_a_structure_without_memory_has_no_path():
    with pytest.raises(ValueError, match=r"slider.backbone is missing: others have no memory"):
        hpcsweep.Slider((1.0,), 1.0, 1.0).path([1.0])
    slider = hpcsweep.Slider((1.0,), 1.0, 1.0, backbone=hpcsweep.Backbone(1.0, 2.0))
    with pytest.raises(ValueError, match="elongations must be"):
        slider.path([1.0, float("nan")])


def test_responses_at_a_scale_are_those_of_lengths_over_it():
    """A structure whose lengths are all L times as large moves L times as far."""
    backbone = hpcsweep.Backbone(1.0, 3.0, 9.0, 0.1, 0.05, "peak-oriented", 5.0)
    record = hpcsweep.Record(np.sin(np.arange(200) * 0.2) * np.hanning(200), 0.2)
    moved = []
    for unit in (1.0, 4.0):
        slider = hpcsweep.Slider((1.0,), 1.0, 0.1 * unit, backbone=backbone.measured_by(1 / unit))
        one = hpcsweep.Structure.from_matrices(
            [1.0], [[1e-9]], [], sliders=[slider], collapse_drift=50.0 * unit, damping_ratio=0.02
        )
        moved.append(hpcsweep.response(one, record, scale=unit))
    assert moved[1].drift == pytest.approx(4.0 * moved[0].drift, rel=1e-12)
    assert moved[1].plastic_path == pytest.approx(4.0 * moved[0].plastic_path, rel=1e-12)
    assert moved[0].excursions[0] > 2

"""A record holds what it was given, read-only, and refuses what is none in one line."""

import math
import pickle

import numpy as np
import pytest
from together import together

from hpcsweep import Record
from hpcsweep.model.record import MAX_SAMPLES


def test_a_record_says_its_size_and_peak():
    record = Record([0.0, 1, -3.0, 2.0], 0.5, "pulse")
    assert (record.n_samples, record.duration, record.peak) == (4, 1.5, 3.0)
    np.testing.assert_array_equal(record.times, [0.0, 0.5, 1.0, 1.5])
    assert record.acceleration.dtype == np.float64
    assert repr(record) == "Record('pulse', 4 samples, dt=0.5, peak=3)"


def test_its_samples_are_a_copy_that_is_read_only_also_when_unpickled():
    samples = np.array([0.0, 1.0])
    record = Record(samples, 0.1)
    samples[1] = 7.0
    assert record.acceleration[1] == 1.0
    for one in (record, pickle.loads(pickle.dumps(record))):
        with pytest.raises(ValueError, match="read-only"):
            one.acceleration[0] = 1.0


def test_records_are_equal_by_content():
    record = Record([0.0, 1.0], 0.1, "a")
    same = Record((-0.0, 1), np.float64(0.1), "a")
    assert record == same
    assert hash(record) == hash(same)
    others = [Record([0.0, 2.0], 0.1, "a"), Record([0.0, 1.0], 0.2, "a"), Record([0.0, 1.0], 0.1)]
    assert record not in [*others, Record([0.0, 1.0, 0.0], 0.1, "a"), "a"]


def test_scaling_multiplies_the_samples():
    scaled = Record([0.0, 1.0, -3.0], 0.1, "a").scaled(-2)
    assert scaled == Record([0.0, -2.0, 6.0], 0.1, "a")


@together(
    "acceleration, dt, name, message",
    [
        ([1.0], 0.1, "", "acceleration must have from 2 to 500000 samples, has 1"),
        ([], 0.1, "", "acceleration must have from 2 to 500000 samples, has 0"),
        (np.zeros(MAX_SAMPLES + 1), 0.1, "", "from 2 to 500000 samples, has 500001"),
        (np.zeros((2, 2)), 0.1, "", r"acceleration must have one dimension, has shape \(2, 2\)"),
        ([0.0, math.nan], 0.1, "", "acceleration must be finite, is nan at sample 2"),
        ([0.0, 1.0, -math.inf], 0.1, "", "acceleration must be finite, is -inf at sample 3"),
        (["0", "1"], 0.1, "", "acceleration must be an array of numbers"),
        (None, 0.1, "", "acceleration must be an array of numbers, is None"),
        ([0.0, 1.0], 0.0, "", "dt must be finite and positive, is 0.0"),
        ([0.0, 1.0], math.inf, "", "dt must be finite, is inf"),
        ([0.0, 1.0], "0.01", "", "dt must be a number, is '0.01'"),
        ([0.0, 1.0], 0.1, 3, "name must be a text, is 3"),
    ],
)
def test_what_is_no_record_is_refused(acceleration, dt, name, message):
    with pytest.raises(ValueError, match=message) as error:
        Record(acceleration, dt, name)
    assert "\n" not in str(error.value)


def test_a_scale_must_be_finite():
    with pytest.raises(ValueError, match="factor must be finite, is inf"):
        Record([0.0, 1.0], 0.1).scaled(math.inf)

"""The table of demands has the form that loss tools read."""

import csv

import numpy as np
import pytest
from together import together

from hpcsweep import write_demands

DRIFT = [[0.01, 0.02], [0.011, 0.03], [0.012, 0.04]]
FLOORS = [[3.0, 4.0], [3.1, 0.1 + 0.2], [3.2, 4.2]]
GROUND = [2.0, 2.1, 2.2]


def test_names_units_and_values(tmp_path):
    path = tmp_path / "demands.csv"
    write_demands(path, DRIFT, FLOORS, GROUND)
    with path.open(newline="") as stream:
        table = list(csv.reader(stream))
    assert table[0] == ["", "1-PFA-0-1", "1-PFA-1-1", "1-PFA-2-1", "1-PID-1-1", "1-PID-2-1"]
    assert table[1] == ["Units", "mps2", "mps2", "mps2", "rad", "rad"]
    assert [row[0] for row in table[2:]] == ["0", "1", "2"]
    found = np.array([row[1:] for row in table[2:]], float)
    np.testing.assert_array_equal(found, np.column_stack([GROUND, FLOORS, DRIFT]))


def test_rows_have_the_names_of_records(tmp_path):
    path = tmp_path / "demands.csv"
    write_demands(path, DRIFT, FLOORS, GROUND, records=["RSN6, 180", "b", "c"])
    with path.open(newline="") as stream:
        assert [row[0] for row in csv.reader(stream)] == ["", "Units", "RSN6, 180", "b", "c"]


def test_other_units_events_and_directions(tmp_path):
    path = tmp_path / "demands.csv"
    write_demands(path, DRIFT, FLOORS, GROUND, unit="g", event=3, direction=2)
    lines = path.read_text().splitlines()
    assert lines[0] == ",3-PFA-0-2,3-PFA-1-2,3-PFA-2-2,3-PID-1-2,3-PID-2-2"
    assert lines[1] == "Units,g,g,g,rad,rad"


def test_residual_drifts_and_spectral_accelerations(tmp_path):
    path = tmp_path / "demands.csv"
    given = DRIFT, FLOORS, GROUND
    write_demands(path, *given, residual_drift=FLOORS, spectral_acceleration={0.5: DRIFT[0] + [7]})
    with path.open(newline="") as stream:
        table = list(csv.reader(stream))
    assert table[0][-3:] == ["1-RID-1-1", "1-RID-2-1", "1-SA_0.5-0-1"]
    assert table[1][-3:] == ["rad", "rad", "mps2"]
    found = np.array([row[-3:] for row in table[2:]], float)
    np.testing.assert_array_equal(found, np.column_stack([FLOORS, DRIFT[0] + [7]]))


@together(
    "given, message",
    [
        ({"drift_ratio": [0.1]}, "drift_ratio must have two dimensions"),
        ({"floor_acceleration": [[1.0]]}, r"floor_acceleration must have shape \(3, 2\)"),
        ({"ground_acceleration": [1.0]}, r"ground_acceleration must have shape \(3,\), has"),
        ({"drift_ratio": [[0.01, np.nan]] * 3}, "1-PID-2-1 must be finite and at least 0, is nan"),
        ({"ground_acceleration": [1.0, -1.0, 2.0]}, "1-PFA-0-1 must be finite .* is -1.0"),
        ({"unit": "parsec"}, "unit must be one of mps2, .* is 'parsec'"),
        ({"records": ["a"]}, "records must have 3 names, has 1"),
        ({"residual_drift": [[1.0]]}, r"residual_drift must have shape \(3, 2\), has \(1, 1\)"),
        ({"spectral_acceleration": {0.5: [1.0]}}, r"SA_0.5, must have shape \(3,\), has \(1,\)"),
        ({"direction": 0}, "direction must be a whole number from 1"),
    ],
)
def test_what_are_no_demands_is_refused_and_nothing_is_written(tmp_path, given, message):
    path = tmp_path / "demands.csv"
    good = {"drift_ratio": DRIFT, "floor_acceleration": FLOORS, "ground_acceleration": GROUND}
    with pytest.raises(ValueError, match=message):
        write_demands(path, **{**good, **given})
    assert not path.exists()

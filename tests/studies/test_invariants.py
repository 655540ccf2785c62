"""What a variable declares of itself is checked of every run, and of every slot of one."""

import numpy as np
from together import together

from hpcsweep import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.invariants import of_each
from hpcsweep.studies.variable import FINITE, VALID, code, contacts, count, real

SLOTS = {"thing": "thing_id"}
VARIABLES = [
    code("outcome", (), Outcome, "", failed=VALID),
    code("rule", (), SkipRule, "", limits=(0, np.inf)),
    real("size", ("point",), "1", ""),
    real("perhaps", ("point",), "1", "", optional=True),
    real("end", (), "1", "", FINITE, failed=VALID),
    contacts("contact", ()),
    count("thing_id", ("thing",), ""),
    real("thing_size", ("thing",), "1", ""),
]
SOUND = {
    "outcome": np.array([1, 1, 3], np.int8),
    "rule": np.array([0, 3, 0], np.int8),
    "size": np.array([[0.0, 2.0], [1.0, 1.0], [np.nan, np.nan]]),
    "perhaps": np.array([[1.0, np.nan], [np.nan, np.nan], [np.nan, np.nan]]),
    "end": np.array([-1.0, 0.0, 5.0]),
    "contact": np.array([1, 0, 0], np.uint64),
    "thing_id": np.array([[1, 2], [1, 0], [0, 0]], np.int32),
    "thing_size": np.array([[1.0, 2.0], [3.0, np.nan], [np.nan, np.nan]]),
}


@together(
    "name, at, value, invariant",
    [
        ("outcome", 1, 6, "outcome is one of 1 to 5"),
        ("rule", 0, 4, "rule is one of 0 to 3"),
        ("rule", 2, 1, "rule of a failed run is 0"),
        ("size", (0, 1), -1.0, "size is finite and not negative"),
        ("size", (1, 0), np.nan, "size is finite and not negative"),
        ("size", (2, 0), 1.0, "size of a failed run is nan"),
        ("perhaps", (0, 1), np.inf, "perhaps is finite and not negative"),
        ("end", 2, np.nan, "end is finite"),
        ("contact", 1, 4, "contact has bits of existing contacts only"),
        ("thing_size", (0, 1), np.inf, "thing_size is finite and not negative"),
        ("thing_size", (1, 1), 0.0, "thing_size where there is no thing is nan"),
    ],
)
def test_only_what_is_wrong_is_told_and_in_its_run(name, at, value, invariant):
    rows = {key: values.copy() for key, values in SOUND.items()}
    structure = Structure(1, 10.0)
    found = of_each(VARIABLES, rows, structure, SLOTS)
    assert not any(where.any() for where in found.values())
    rows[name][at] = value
    found = of_each(VARIABLES, rows, structure, SLOTS)
    row = at if isinstance(at, int) else at[0]
    assert {key for key, where in found.items() if where[row]} >= {invariant}
    assert not any(where[k] for where in found.values() for k in {0, 1, 2} - {row})

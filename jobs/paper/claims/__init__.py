"""The claims of the paper, each answered yes, no or cannot tell, with our numbers.

`data` holds the sweeps and maps as arrays; `judgement` has a pure function for each claim;
`evidence` reads the files and integrates what they do not hold; `report` writes the tables.
"""

from claims.data import Claim, Map, Sweep, Verdict
from claims.evidence import variant_of
from claims.judge import judge_files

__all__ = ["Claim", "Map", "Sweep", "Verdict", "judge_files", "variant_of"]

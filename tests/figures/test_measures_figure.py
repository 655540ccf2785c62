"""The figure of measures, from the command line."""

from tools import SMALL

from hpcsweep.campaign import run as campaign
from hpcsweep.commands.cli import main
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial


def test_measures_are_drawn_where_they_are_held(tmp_path, capsys):
    for name, more in (
        ("held", "storey_drift = true\ncontact_force = true\nimpacts = true\n"),
        ("none", ""),
    ):
        path = tmp_path / f"{name}.h5"
        assert campaign.run(parse_job(SMALL + more, name, name), path, Serial()) == 0
    picture = tmp_path / "measures.png"
    arguments = ("--kind", "measures", "--omega", "0.6", "--direction", "down", "-o", str(picture))
    assert main(["plot", str(tmp_path / "held.h5"), *arguments]) == 0
    assert picture.stat().st_size > 10_000
    picture.unlink()
    assert main(["plot", str(tmp_path / "none.h5"), *arguments]) == 2
    assert "holds none of them: set one of output.storey_drift" in capsys.readouterr().err
    assert not picture.exists()

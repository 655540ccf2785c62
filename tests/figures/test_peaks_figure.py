"""The figure of peaks, from the command line."""

from tools import SMALL

from hpcsweep.campaign import run as campaign
from hpcsweep.commands.cli import main
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial


def test_peaks_are_drawn_where_they_are_held(tmp_path, capsys):
    for name, more in (("peaks", "storey_drift = true\ncontact_force = true\n"), ("none", "")):
        path = tmp_path / f"{name}.h5"
        assert campaign.run(parse_job(SMALL + more, name, name), path, Serial()) == 0
    picture = tmp_path / "peaks.png"
    arguments = ("--kind", "peaks", "--omega", "0.6", "--direction", "down", "-o", str(picture))
    assert main(["plot", str(tmp_path / "peaks.h5"), *arguments]) == 0
    assert picture.stat().st_size > 10_000
    picture.unlink()
    assert main(["plot", str(tmp_path / "none.h5"), *arguments]) == 2
    assert "holds no peaks: set one of output.storey_drift" in capsys.readouterr().err
    assert not picture.exists()

"""Files of matrices as programs write them: what they say is compared with what they hold."""

import os
import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy import io, sparse
from together import together

from hpcsweep import read_model

K = np.array([[3000.0, -1000.0], [-1000.0, 1000.0]])
M = np.diag([2.0, 1.0])
MARKET = (
    "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 3000.\n2 1 -1000.\n2 2 1000.\n"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the masses."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "M.csv").write_text("2;0\n0;1\n")
    return tmp_path


def market(head: str, body: str) -> str:
    return f"%%MatrixMarket matrix {head}\n{body}"


RIGHT = [
    ("K.mtx", MARKET),
    ("StiffnessMatrix.mm", MARKET),
    ("K.mtx", f" {MARKET}"),
    ("K.mtx", f"\ufeff{MARKET}"),
    ("K.mtx", MARKET.lower()),
    ("K.mtx", MARKET.removeprefix("%")),
    ("K.mtx", MARKET.replace("real", "integer").replace(".\n", "\n")),
    ("K.mtx", MARKET.replace("\n2 2 3", "\n% Müller\n\n%\n2 2 3").encode("latin-1")),
    ("K.mtx", MARKET.replace("3000.", "3.00D+03").replace("-1000.", "-1.0d3")),
    ("K.mtx", MARKET.replace("2 1 -1000.", "1 2 -1000.")),
    ("K.mtx", market("array real symmetric", "2 2\n3000\n-1000\n1000\n")),
    ("K.mtx", market("array real general", "2 2\n3000\n-1000\n-1000\n1000\n")),
    ("K.csv", "3000,-1000\n-1000,1000\n"),
    ("K.csv", "\ufeff3000.0;-1000\n-1000;1000"),
    ("K.csv", "3000,0;-1000,0\n-1000,0;1000,0"),
    ("K.csv", "3.000,0;-1000,0\n-1.000,0;1.000,0"),
    ("K.csv", "# stiffness N/m\n\n3000,-1000\n-1000,1000\n"),
    ("K.txt", "3.0D+03 -1.0D+03\n-1.0D+03 1.0D+03\n"),
    ("K.txt", "3000 0\n-1000 1000\n"),
]


@together("name, text", RIGHT)
def test_what_programs_write_is_read_right(folder, name, text):
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    found = read_model([name, "M.csv"])
    assert np.array_equal(found.stiffness.toarray(), K)
    assert np.array_equal(found.mass.toarray(), M)


BILLION = market("coordinate real symmetric", "1000000000 1000000000 1\n1 1 1.0\n")
WRONG = [
    ("K.mtx", MARKET.replace("2 2 3", "2 2 4"), "must have 4 entries, as line 2 says, has 3"),
    ("K.mtx", MARKET.replace("2 2 3", "2 3"), "rows, columns and entries, line 2 is '2 3'"),
    ("K.mtx", MARKET.replace("2 1 -", "2 0 -"), r"from 1 to 2 and 2, line 4 has \(2, 0\)"),
    ("K.mtx", MARKET.replace("2 1 -", "2 1.5 -"), r"line 4 has \(2, 1.5\)"),
    ("K.mtx", MARKET.replace("2 1 -", "2 2 -"), r"entry \(2, 2\) is given twice"),
    ("K.mtx", MARKET.replace("2 1 -1000.", "2 1"), "line 4 has 2 numbers"),
    ("K.mtx", MARKET.replace("2 1 -1000.", "2 1 nan"), "finite number, line 4 has 'nan'"),
    ("K.mtx", MARKET.replace("2 1 -1000.", "2 1 -1.0+03"), "number, line 4 has '-1.0.03'"),
    ("K.mtx", MARKET.replace("2 1 -1000.", "2 1 -1_000."), "number, line 4 has '-1_000.'"),
    ("K.mtx", MARKET.replace("2 1 -1000.", "2 1 -1e999"), "finite number, line 4 has .-1e999."),
    ("K.mtx", MARKET.replace("real", "complex"), "real or integer"),
    ("K.mtx", MARKET.replace("symmetric", "skew-symmetric"), "general or symmetric"),
    (
        "K.mtx",
        MARKET.replace("2 2 3", "2 2 4") + "1 2 -1000.\n",
        "says that it is symmetric, and has entries on both sides",
    ),
    ("K.mtx", BILLION, "must have 300000 rows and columns at most, is 1000000000 x 1000000000"),
    ("K.mtx", market("array real symmetric", "2 2\n1\n2\n"), "must have 3 entries, as line 2 says"),
    ("K.mtx", "1,1, 1,1, 2.0\n2,1, 1,1, -1.0\n2,1, 2,1, 1.0\n", "entry, of Abaqus"),
    ("K.txt", "1 1 3\n2 1 -1\n2 2 1\n3 3 1\n", "looks like a list of entries .* MatrixMarket"),
    ("K.txt", "1 1 2000.5\n2 1 -1000.25\n2 2 1000.75\n", "a list of entries .* MatrixMarket"),
    ("K.rb", "Title\n 4 1 1 2\nRUA  2 2 4 0\n(40I2)\n 1 3 5\n", "is Harwell-Boeing, which is not"),
    ("K.pch", "DMIG    KAAX           0       6\n", "is DMIG of Nastran, which is not read"),
    ("K.csv", "u1,u2\n3000,-1000\n-1000,1000\n", "line 1 has 'u1'"),
    ("K.csv", ",0,1\n0,3000,-1000\n1,-1000,1000\n", "line 1 has 2 numbers, line 2 has 3"),
    ("K.csv", "200.000;-100.000\n-100.000;100.000\n", "200.000 may be 200000 or a decimal"),
    ("K.txt", "1 2\n3\n", "line 1 has 2 numbers, line 2 has 1"),
    ("K.txt", "1 2 3 4\n", "stiffness must be a square matrix, is 1 x 4"),
    ("K.txt", "", "is empty"),
    ("K.npz", b"PK\x03\x04 and no more", "is cut off or damaged"),
    ("K.npz", b"hello", "is no .npz file of numpy"),
    ("K.mat", b"MATLAB 7.3 MAT-file", "is a MATLAB file of version 7.3, .* '-v7'"),
    ("K.bin", b"\x01\x02\x00\x03", "must be a text, has bytes of 0"),
]


@together("name, text, said", WRONG)
def test_what_is_not_as_it_says_is_refused_in_one_line(folder, name, text, said):
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=rf"^{name}: .*{said}") as caught:
        read_model([name, "M.csv"])
    assert len(str(caught.value).splitlines()) == 1


def test_damaged_arrays_are_refused_before_they_are_read(folder):
    np.savez("objects.npz", K=np.array([sparse.csr_array(K)], dtype=object), M=M)
    np.save("K.npy", K)
    content = Path("K.npy").read_bytes()
    Path("K.npy").write_bytes(content.replace(b"(2, 2)", b"(9999999999, 2)".ljust(6)))
    sparse.save_npz("down_K.npz", sparse.csr_array(K))
    parts = dict(np.load("down_K.npz"))
    np.savez("down_K.npz", **{**parts, "indptr": np.array([4, 0, 4])})
    np.savez("wide_K.npz", **{**parts, "indices": np.array([0, 1, 0, 10**6])})
    np.savez("many_K.npz", **{**parts, "shape": np.array([10**9, 10**9])})
    sparse.save_npz("coo_K.npz", sparse.coo_array(([1.0], ([0], [0])), shape=(10**9, 10**9)))
    assert Path("coo_K.npz").stat().st_size < 2000
    for name, said in (
        ("objects.npz", "is cut off or damaged, or holds objects of Python: scipy.sparse.save_npz"),
        ("K.npy", "is cut off or damaged|must have arrays of 1 GB at most"),
        ("down_K.npz", "stiffness must be a matrix of real numbers|is cut off or damaged"),
        ("wide_K.npz", "stiffness must be a matrix of real numbers|is cut off or damaged"),
        ("many_K.npz", "must have 300000 rows and columns at most, is 1000000000 x 1000000000"),
        ("coo_K.npz", "must have 300000 rows and columns at most, is 1000000000 x 1000000000"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: (.* )?({said})"):
            read_model([name, "M.csv"] if name != "objects.npz" else name)


def test_what_a_library_crashes_at_is_refused_in_a_line(folder):
    io.savemat("model.mat", {"K": sparse.csc_array(np.pad(K, (0, 8))), "M": np.eye(10)})
    content = bytearray(Path("model.mat").read_bytes())
    at = content.index(struct.pack("<3i", 0, 2, 4))  # its column pointers
    content[at + 4 : at + 8] = struct.pack("<i", 2**30)
    Path("broken.mat").write_bytes(content)
    Path("short.mat").write_bytes(content[: len(content) // 2])
    for name in ("broken.mat", "short.mat"):
        with pytest.raises(ValueError, match=rf"^{name}: is (no .mat file|cut off or damaged)"):
            read_model(name)


def test_pipes_and_devices_are_refused(folder):
    os.mkfifo("K.txt")
    for name in ("K.txt", "/dev/zero", "."):
        paths = [name, "M.csv"]
        with pytest.raises(ValueError, match="must be a regular file"):
            read_model(paths)
    with pytest.raises(ValueError, match=r"^path must be a path, is None"):
        read_model(None)


def test_what_is_not_used_is_told(folder):
    """Nine of ten programs have their own name for damping."""
    np.savez("beam.npz", M=M, K=K, D=0.01 * K, note="text", n=2)
    told = "^beam.npz: D of beam.npz is not used: names are M or mass, K or stiffness, C or damp"
    with pytest.warns(UserWarning, match=told):
        assert read_model("beam.npz").damping is None
    (folder / "own").mkdir()
    for name, matrix in {"K": K, "M": M, "E": 0.01 * K, "C": [[0.0, 1.0]]}.items():
        io.mmwrite(f"own/beam_{name}.mtx", sparse.coo_array(matrix))
    (folder / "own/README.txt").write_text("a beam\n")
    with pytest.raises(ValueError, match=r"beam_C.mtx: damping must be a square matrix, is 1 x 2"):
        read_model("own")
    Path("own/beam_C.mtx").unlink()
    with pytest.warns(UserWarning, match=r"^own: E of beam_E.mtx is not used"):
        assert read_model("own").damping is None


def test_names_of_files_and_of_coordinates_must_agree(folder):
    np.savez("K.npz", M=K)
    with pytest.raises(ValueError, match=r"^K.npz: holds the mass, M, and its name says stiffness"):
        read_model(["K.npz", "M.csv"])
    np.savez("K.npz", K=K, names=["1.UX", "2.UX"])
    np.savez("M.npz", M=M, names=["2.UX", "1.UX"])
    with pytest.raises(ValueError, match=r"^M.npz: names are not those of K.npz"):
        read_model(["K.npz", "M.npz"])
    np.savez("M.npz", M=M, names=["1.UX", "2.UX"])
    assert read_model(["K.npz", "M.npz"]).names == ("1.UX", "2.UX")


def test_supports_in_the_diagonals_are_fixed_and_told(folder):
    """1 in K and M, as finite element programs leave what moves with the ground."""
    held = {"K": np.pad(K, (1, 0)), "M": np.pad(M, (1, 0)), "names": ["1.UX", "2.UX", "3.UX"]}
    held["K"][0, 0] = held["M"][0, 0] = 1.0
    np.savez("wall.npz", **held)
    said = "1 coordinate is taken as fixed, with equal numbers .* joined to no other: 1.UX"
    with pytest.warns(UserWarning, match=said):
        model = read_model("wall.npz")
    found = model.structure(outputs=["3.UX"])
    assert found.frequencies == pytest.approx(np.sqrt([500.0, 2000.0]))
    assert found.reduction.empty == 1
    assert sum(found.reduction.shares) == pytest.approx(1.0)
    assert re.match(said, found.reduction.told[0])
    # what a job names is not taken away, and other numbers are only told
    assert model.structure(outputs=["1.UX", "3.UX"]).frequencies[0] == pytest.approx(1.0)
    held["K"][0, 0] = 50.0
    np.savez("wall.npz", **held)
    with pytest.warns(UserWarning, match=r"1 coordinate is joined to no other: 1.UX; fixed = "):
        assert read_model("wall.npz").structure(outputs=["3.UX"]).n_floors == 3


@together("penalty", [1e8, 1e12, 1e15, 1e18, 1e22])
def test_penalty_springs_hold_supports(folder, penalty):
    stiffness = np.array([[2e6 + penalty, -2e6, 0], [-2e6, 3e6, -1e6], [0, -1e6, 1e6]])
    np.savez("penalty.npz", K=stiffness, M=np.diag([1.0, 200.0, 100.0]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = read_model("penalty.npz")
    soft = 1.0 / (1.0 / 2e6 + 1.0 / penalty)  # the spring behind the wall's own
    squares = np.linalg.eigvalsh(
        np.array([[(soft + 1e6) / 200.0, -1e6 / np.sqrt(2e4)], [-1e6 / np.sqrt(2e4), 1e4]])
    )
    for reduce in (None, {"modes": 2}):
        found = model.structure(outputs=["3"], reduce=reduce).frequencies[:2]
        assert found == pytest.approx(np.sqrt(squares), rel=1e-4 / np.sqrt(penalty / 1e8) + 1e-9)


def test_lagrange_multipliers_are_counted(folder):
    """Rows with 0 on the diagonal: each is a constraint that is still to be eliminated."""
    tied = np.block([[K, np.eye(2)], [np.eye(2), np.zeros((2, 2))]])
    np.savez("tied.npz", K=tied, M=np.diag([2.0, 1.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="has 2 of 0 at 3, 4: Lagrange multipliers"):
        read_model("tied.npz")

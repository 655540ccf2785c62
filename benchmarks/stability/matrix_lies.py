"""Pairs of matrices in files of ten formats, with one lie each: read right, told, or refused."""

import argparse
import io
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.io
from scipy import sparse

import hpcsweep

LIES = ("header", "count", "exponent", "name", "shape", "symmetry", "order", "base")
Model = dict[str, np.ndarray]


def model(rng) -> Model:
    """Return M, lumped or not, and K of masses in a row, with some springs across."""
    n = int(rng.integers(3, 7))
    stiffness = np.diag(rng.uniform(100.0, 900.0, n).round(3))
    for i in range(n):
        for j in range(i):
            if j == i - 1 or rng.random() < 0.3:
                row = np.eye(n)[i] - np.eye(n)[j]
                stiffness += round(rng.uniform(1e3, 9e3), 3) * np.outer(row, row)
    mass = np.diag(rng.uniform(1.0, 5.0, n).round(3))
    if rng.random() < 0.5:
        mass += np.diag([0.25] * (n - 1), 1) + np.diag([0.25] * (n - 1), -1)
    return {"K": stiffness, "M": mass}


def _changed(true: Model, lie: str, rng) -> dict[str, np.ndarray]:
    """Return the matrices with a lie that is in the numbers, in one of them."""
    found = {name: one.copy() for name, one in true.items()}
    name = "KM"[int(rng.integers(2))]
    one, n = found[name], len(true["K"])
    if lie == "shape":
        found[name] = [one[:-1, :-1], one[:, :-1], one[:1]][int(rng.integers(2 + (name == "K")))]
    elif lie == "symmetry":  # of K: a single entry beside a diagonal may be a triangle
        i = int(rng.integers(1, n))
        found["K"][i, i - 1] *= 1.1
    elif lie == "order":
        found[name] = np.roll(one, 1, axis=0)
    elif lie == "base":
        found[name] = np.hstack((np.arange(n)[:, None] + float(rng.integers(2)), one))
    return found


def _edit_numbers(text: str, rng) -> str:
    """Write exponents as Fortran does, with its letter or without."""
    return text.replace("e+", ["D+", "d+", "+"][int(rng.integers(3))])


def _lines(text: str, lie: str, rng, first: int) -> str:
    """Tell a lie in the lines of a text, whose numbers begin at a line."""
    lines = text.splitlines()
    if lie == "count":
        k = int(rng.integers(first, len(lines)))
        lines[k : k + 1] = [] if rng.random() < 0.5 else [lines[k], lines[k]]
    elif lie == "exponent":
        return "\n".join([*lines[:first], _edit_numbers("\n".join(lines[first:]), rng)])
    return "\n".join(lines) + "\n"


def _market(matrix: np.ndarray, lie: str, rng, form: str, symmetry: str) -> str:
    n, m = matrix.shape
    places = [(i, j) for j in range(m) for i in range(n)]
    if symmetry == "symmetric":
        places = [(i, j) for i, j in places if i >= j]
        if lie == "order" and form == "array":
            places.sort()
    said = symmetry
    if lie == "symmetry":
        said = {"symmetric": "general", "general": "symmetric"}[symmetry]
    field, sizes = "real", [n, m]
    if form == "coordinate":
        places = [(i, j) for i, j in places if matrix[i, j]]
        sizes.append(len(places))
    if lie == "header":
        kind = int(rng.integers(5))
        field, said = (
            ("complex", said) if kind == 0 else ("pattern", said) if kind == 1 else (field, said)
        )
        said = "skew-symmetric" if kind == 2 else said
        sizes[-1] += kind == 3
        form = {"array": "coordinate", "coordinate": "array"}[form] if kind == 4 else form
    base = 0 if lie == "base" else 1
    lines = [f"%%MatrixMarket matrix {form} {field} {said}", " ".join(map(str, sizes))]
    for i, j in places:
        value = f"{matrix[i, j]:.16e}"
        words = (f"{i + base}", f"{j + base}", value)
        if lie == "order" and len(sizes) == 3:
            words = words[::-1]
        lines.append(" ".join(words) if len(sizes) == 3 else value)
    return _lines("\n".join(lines), lie, rng, 2)


def _abaqus(matrices: Model, lie: str, rng) -> str:
    lines = ["** substructure", f"*USER ELEMENT, NODES={len(matrices['K'])}, LINEAR"]
    for name, matrix in matrices.items():
        kind = {"K": "STIFFNESS", "M": "MASS"}[name]
        kind = "STIFNES" if lie in ("header", "name") and name == "K" else kind
        lines.append(f"*MATRIX,TYPE={kind}")
        matrix = matrix[: min(matrix.shape), : min(matrix.shape)]
        low = np.tril_indices(len(matrix))
        entries = matrix[low if lie != "order" else np.triu_indices(len(matrix))]
        if lie == "symmetry":
            entries = matrix.ravel()
        lines += [
            ", ".join(f"{x:.16e}" for x in entries[k : k + 4]) for k in range(0, len(entries), 4)
        ]
    return _lines("\n".join(lines), "" if lie == "base" else lie, rng, 3)


def _bytes(content: bytes, lie: str, rng) -> bytes:
    if lie == "count":
        return content[: int(rng.integers(len(content) // 2, len(content) - 8))]
    if lie == "header":
        k = int(rng.integers(0, 128))
        return content[:k] + bytes([content[k] ^ 0x55]) + content[k + 1 :]
    return content


def _npy(matrix: np.ndarray, lie: str, rng) -> bytes:
    out = io.BytesIO()
    np.save(out, matrix.astype(complex) + 1j if lie == "exponent" else matrix)
    content = out.getvalue()
    if lie == "header":
        old, new = [(b"<f8", b"<f4"), (b"(", b"(1"), (b"False", b"True ")][int(rng.integers(3))]
        return content.replace(old, new, 1)
    return _bytes(content, lie, rng)


def _sparse(matrix: np.ndarray, lie: str, rng) -> dict[str, np.ndarray]:
    found = sparse.csr_array(matrix)
    parts = {
        "indices": found.indices, "indptr": found.indptr, "format": b"csr",
        "shape": np.array(found.shape), "data": found.data, "_is_array": True,
    }  # fmt: skip
    if lie == "base":
        parts["indices"] = parts["indices"] + 1
    elif lie == "count":
        parts["data"] = parts["data"][:-1]
    elif lie == "order":
        parts["indptr"] = parts["indptr"][::-1].copy()
    elif lie == "header":
        parts["shape"] = np.array([[10**9, 10**9], [-1, 2], [len(matrix)]][int(rng.integers(2))])
    elif lie == "exponent":
        parts["data"] = parts["data"].astype(str)
    return parts


IN_NUMBERS = ("shape", "symmetry")
"""Lies that are in the numbers, whatever the format."""


def _pair(ending: str, write: Callable) -> Callable:
    """Return what writes each matrix to a file of its own."""

    def writer(folder: Path, true: Model, lie: str, rng) -> list[Path]:
        told = lie == "symmetry" and ending in (".mtx", ".mm")  # by the header
        both = _changed(true, lie, rng) if lie in IN_NUMBERS and not told else dict(true)
        # a mass matrix of another order may be one of other masses
        at, paths = "K" if lie == "order" else "KM"[int(rng.integers(2))], []
        for name, matrix in both.items():
            own = {"K": "stifness", "M": "mess"}[name] if lie == "name" and name == at else name
            paths.append(folder / f"beam_{own}{ending}")
            content = write(matrix, lie if name == at else "", rng)
            if isinstance(content, dict):
                np.savez_compressed(paths[-1], **content)
            else:
                paths[-1].write_bytes(content if isinstance(content, bytes) else content.encode())
        return paths

    return writer


def _by_market(form: str, symmetry: str) -> Callable:
    return lambda matrix, lie, rng: _market(
        matrix, lie, rng, form, symmetry if len({*matrix.shape}) == 1 else "general"
    )


def _rows(separator: str) -> Callable:
    def write(matrix: np.ndarray, lie: str, rng) -> str:
        if lie in ("order", "base"):
            matrix = _changed({"K": matrix, "M": matrix}, lie, rng)
            matrix = next(
                one for one in matrix.values() if one.shape[1] > one.shape[0] or lie == "order"
            )
        text = "\n".join(separator.join(f"{x:.16e}" for x in row) for row in matrix)
        if separator == ";":
            text = text.replace(".", ",")
        if lie == "header":
            n = len(matrix)
            head = [f"{n}{separator}{n}", "stiffness", separator.join(f"u{i}" for i in range(n))]
            return head[int(rng.integers(3))] + "\n" + text + "\n"
        return _lines(text, lie, rng, 0)

    return write


def _whole(ending: str) -> Callable:
    """Return what writes all to one file."""

    def writer(folder: Path, true: Model, lie: str, rng) -> list[Path]:
        held = dict(_changed(true, lie, rng))
        if lie == "name":
            held = {["Kstiff", "D", "M_0"][int(rng.integers(3))]: held.pop("K"), **held}
        if lie == "exponent":
            held["K"] = held["K"].astype(complex) * (1 + 1j)
        path = folder / f"beam{ending}"
        if ending == ".sub.mtx":
            path.write_text(_abaqus({k: held.get(k, true[k]).real for k in "KM"}, lie, rng))
        elif ending == ".npz":
            np.savez(
                path, **held, names=[f"{i}.UX" for i in range(len(true["K"]) + (lie == "base"))]
            )
        else:
            both = {k: sparse.csc_array(v) if rng.random() < 0.5 else v for k, v in held.items()}
            scipy.io.savemat(path, both)
        if ending != ".sub.mtx":
            path.write_bytes(_bytes(path.read_bytes(), lie, rng))
        return [path]

    return writer


FORMATS: dict[str, Callable] = {
    "market symmetric": _pair(".mtx", _by_market("coordinate", "symmetric")),
    "market general": _pair(".mm", _by_market("coordinate", "general")),
    "market array": _pair(".mtx", _by_market("array", "symmetric")),
    "rows": _pair(".txt", _rows(" ")),
    "csv": _pair(".csv", _rows(";")),
    "npy": _pair(".npy", _npy),
    "sparse npz": _pair(".npz", _sparse),
    "npz": _whole(".npz"),
    "mat": _whole(".mat"),
    "substructure": _whole(".sub.mtx"),
}


def judge(folder: Path, kind: str, lie: str, seed: int) -> tuple[str, str]:
    """Return what becomes of a pair, "right", "told" or "refused", and what is said."""
    rng = np.random.default_rng(seed)
    true = model(rng)
    paths = FORMATS[kind](folder, true, lie, rng)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            found = hpcsweep.read_model([str(path) for path in paths])
        except ValueError as error:
            said = str(error)
            words = ("inhomogeneous", "allow_pickle", "broadcast", "dtype", "convert", "reshape")
            is_plain = "\n" not in said and not any(word in said for word in words)
            is_named = said.startswith(str(folder))
            return ("refused" if is_plain and is_named else "wrong"), said
    same = all(
        one.shape == true[name].shape and np.allclose(one.toarray(), true[name], rtol=1e-12)
        for name, one in (("K", found.stiffness), ("M", found.mass))
    )
    said = "; ".join(str(one.message) for one in told)
    return ("told" if said else "right") if same else "wrong", said


def main() -> None:
    """Judge many pairs; print those that are read wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print what is said of each")
    options = parser.parse_args()
    kinds = [(kind, lie) for kind in FORMATS for lie in LIES]
    counts: Counter[str] = Counter()
    for k in range(options.pairs):
        kind, lie = kinds[k % len(kinds)]
        with tempfile.TemporaryDirectory() as folder:
            outcome, said = judge(Path(folder), kind, lie, options.seed * 10**6 + k)
        counts[outcome] += 1
        if outcome == "wrong" or options.show:
            print(f"{outcome}: {kind}, {lie}, pair {k}: {said}")
    print(", ".join(f"{n} {outcome}" for outcome, n in counts.items()))
    raise SystemExit(counts["wrong"] > 0)


if __name__ == "__main__":
    main()

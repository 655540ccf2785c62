"""Encode arrays as compact text in a page: quantised, predicted, byte planes, deflate, base64.

The decoder is ``assets/codec.js``.
"""

import base64
import zlib

import numpy as np


def resolution(low: np.ndarray | float, high: np.ndarray | float, bits: int) -> np.ndarray:
    """Return the step between quantised values that cover [`low`, `high`].

    The integers 1 to 2^bits - 1 are used, the first and the last exact, so a value is recovered
    within half a step.
    """
    return (np.asarray(high, float) - np.asarray(low, float)) / (2**bits - 2)


def quantise(values: np.ndarray, low, high, bits: int) -> np.ndarray:
    """Round values in [`low`, `high`] to integers from 1 to 2^bits - 1; 0 is NaN.

    Parameters
    ----------
    values : ndarray of float
        Finite or NaN.
    low, high : float or ndarray that broadcasts with `values`
    bits : int
        2 to 16.

    Returns
    -------
    ndarray of uint16, same shape
    """
    step = resolution(low, high, bits)
    step = np.where(step > 0, step, 1.0)
    levels = np.clip(np.rint((values - low) / step), 0, 2**bits - 2) + 1
    return np.where(np.isfinite(values), levels, 0).astype(np.uint16)


def predict_rows(codes: np.ndarray) -> np.ndarray:
    """Replace each value by its difference (modulo its type) to the one before on the last axis."""
    differences = codes.copy()
    differences[..., 1:] -= codes[..., :-1]
    return differences


def predict_points(codes: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Replace points by differences (modulo 2^16) to the same point of the run before.

    A run whose number of points differs from the run's before is left as it is.

    Parameters
    ----------
    codes : ndarray of uint16, shape (n, n_points)
        Points of all runs, consecutively.
    counts : ndarray of int, shape (n_sweeps, n_amplitudes)
        Points of each run.

    Returns
    -------
    ndarray of uint16, same shape as `codes`
    """
    same = np.zeros(counts.shape, bool)
    same[:, 1:] = counts[:, 1:] == counts[:, :-1]
    back = np.repeat(np.where(same, counts, 0).ravel(), counts.ravel())
    index = np.arange(codes.shape[1])
    before = np.where(back > 0, codes[:, index - back], 0)
    return (codes - before).astype(np.uint16)


def pack(codes: np.ndarray, row: int = 0, **notes) -> tuple[dict, str]:
    """Return what the decoder needs to know of an array, and its text.

    Parameters
    ----------
    codes : ndarray of unsigned integers
    row : int
        Length of the rows along which values are predicted; 0: they are not.
    **notes
        What the page is told besides.
    """
    text = to_text(predict_rows(codes) if row else codes)
    return {"bytes": codes.itemsize, "length": codes.size, "row": row, **notes}, text


def to_text(codes: np.ndarray) -> str:
    """Write an array of unsigned integers as base64 of its deflated byte planes.

    All low bytes come first, the high bytes last: smooth data give long runs of equal bytes.
    Without these, a search for longer matches finds nothing either and takes ten times as long.
    """
    deflate = zlib.compressobj(strategy=zlib.Z_RLE)
    flat = np.ascontiguousarray(codes.ravel()).astype(codes.dtype.newbyteorder("<"))
    planes = flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    packed = deflate.compress(planes.tobytes()) + deflate.flush()
    return base64.b64encode(packed).decode("ascii")

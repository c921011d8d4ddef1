"""Zero-phase low-passes, derivatives and spectra of evenly sampled signals, along the first axis.

The low-pass is a symmetric FIR filter (windowed sinc, Kaiser window), so that nothing is shifted in
time, and one output sample needs a known number of inputs: the observation matrix can pass the
same filter block by block.
"""

from collections.abc import Iterable

import numpy as np
import scipy  # whose parts load when they are first used: signal takes half a second

from paramreduce_cli.records import FloatArray

_STOP_BAND = 50.0
"""Attenuation, dB."""
_TRANSITION = 0.8
"""Width of the transition band, a share of the cut-off."""
_NYQUIST = 0.45
"""Cut-offs above this share of the sampling rate leave a signal as it is."""
_ABOVE_FLOOR = 10.0
"""Power over the noise floor at which a frequency belongs to the motion."""
_IN_A_ROW = 5
"""Frequencies below that, one after the other, that end the motion's band."""
_SEGMENTS = 4
"""Segments of the log in a spectrum: the longer, the finer in frequency."""
ANTI_ALIAS = 0.4
"""Cut-off of the low-pass before a lower rate, a share of that rate."""
_OUTPUTS_AT_ONCE = 64
"""Filtered samples that are computed as one product of matrices."""
_DERIVATIVE = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Central differences of eighth order."""


def design_low_pass(cutoff: float, rate: float) -> FloatArray:
    """Return the coefficients of a symmetric low-pass filter, (2 k + 1,), or a single one if no filter is needed.

    Args:
        cutoff: Frequency at which half of the amplitude passes, Hz; may be infinite.
        rate: Samples per second.
    """
    if cutoff >= _NYQUIST * rate:
        return np.ones(1)
    order, beta = scipy.signal.kaiserord(_STOP_BAND, _TRANSITION * cutoff / (0.5 * rate))
    taps: FloatArray = scipy.signal.firwin(order | 1, cutoff, window=("kaiser", beta), fs=rate)
    return taps


def apply_filter(x: FloatArray, taps: FloatArray) -> FloatArray:
    """Return a filtered signal of the same length, or the signal itself for a filter of one coefficient.

    The signal is extended at both ends by its point reflection, which keeps values and slopes.

    Args:
        x: Signals, (n_samples, n).
        taps: Coefficients of the filter, (2 k + 1,).
    """
    k = taps.size // 2
    if k == 0:
        return x
    result = np.empty(x.shape)
    for column, out in zip(x.T, result.T, strict=True):  # one at a time: transforms are large
        out[:] = scipy.signal.oaconvolve(_extend(column, k), taps, mode="valid")
    return result


def _extend(x: FloatArray, k: int) -> FloatArray:
    """Return signals extended by k samples at both ends, (n_samples + 2 k,) or (n_samples + 2 k, n)."""
    if len(x) == 1:
        return np.repeat(x, 2 * k + 1, axis=0)
    while k > 0:  # in steps where the filter is longer than the signal
        step = min(k, len(x) - 1)
        x = np.concatenate([2 * x[0] - x[step:0:-1], x, 2 * x[-1] - x[-2 : -step - 2 : -1]])
        k -= step
    return x


def differentiate(x: FloatArray, rate: float) -> FloatArray:
    """Return the time derivative by central differences of eighth order, as long as the signal."""
    return apply_filter(x, _DERIVATIVE[::-1]) * rate


def filter_samples(
    rows: FloatArray, first: int, taps: FloatArray, outputs: np.ndarray
) -> FloatArray:
    """Return some samples of a filtered signal.

    Args:
        rows: Rows of the signal, (n_rows, n).
        first: Index of the first row within the signal.
        taps: Coefficients of a symmetric filter, (2 k + 1,).
        outputs: Indices of the requested samples; the rows must include their k neighbours.

    Returns:
        (n_outputs, n)
    """
    k = taps.size // 2
    operator = np.zeros((outputs.size, rows.shape[0]))
    for row, output in enumerate(outputs - first):
        operator[row, output - k : output + k + 1] = taps
    result: FloatArray = operator @ rows
    return result


def filter_outputs(rows: FloatArray, taps: FloatArray, outputs: np.ndarray) -> FloatArray:
    """Return some samples of filtered signals that are extended at both ends by their point reflection.

    Args:
        rows: Signals, (n_samples, n).
        taps: Coefficients of a symmetric filter, (2 k + 1,).
        outputs: Indices of the requested samples, ascending.

    Returns:
        (n_outputs, n)
    """
    k = taps.size // 2
    extended = _extend(rows, k)
    parts = [
        filter_samples(extended[some[0] : some[-1] + 2 * k + 1], int(some[0]) - k, taps, some)
        for some in np.split(outputs, range(_OUTPUTS_AT_ONCE, outputs.size, _OUTPUTS_AT_ONCE))
        if some.size
    ]
    return np.concatenate([np.zeros((0, rows.shape[1])), *parts])


def estimate_spectrum(columns: Iterable[FloatArray], rate: float) -> tuple[FloatArray, FloatArray]:
    """Return frequencies, (n_frequencies,), Hz, and power spectral densities, (n_frequencies, n) [Welch1967].

    Args:
        columns: Signals, (n_samples,) each; read one at a time, to save memory.
        rate: Samples per second.
    """
    densities = []
    for column in columns:
        length = max(min(64, column.size), column.size // _SEGMENTS)
        frequency, density = scipy.signal.welch(
            column, rate, window="blackmanharris", nperseg=length, noverlap=3 * length // 4,
            detrend="linear",
        )  # fmt: skip
        densities.append(density)
    return frequency, np.column_stack(densities)


def find_motion_band(frequency: FloatArray, density: FloatArray) -> float:
    """Return the highest frequency up to which a signal stands out of its noise, Hz; of several signals the highest.

    The noise floor is the median density over the upper half of all frequencies.
    """
    upper = frequency > 0.5 * frequency[-1]
    floor = np.median(density[upper], axis=0)
    highest = 0.0
    for above in (density > _ABOVE_FLOOR * floor).T:
        ends = (k for k in range(2, above.size - _IN_A_ROW) if not above[k : k + _IN_A_ROW].any())
        highest = max(highest, float(frequency[next(ends, -1)]))
    return highest

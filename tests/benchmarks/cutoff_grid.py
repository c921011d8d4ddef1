"""Held-out error with the chosen cut-off frequencies beside that of every other pair of a grid, on configs of logs.

All pairs are scored on the torques of one band, that of the search: `python -m tests.benchmarks.cutoff_grid CONFIG...`
"""

import sys
import warnings
from pathlib import Path

import numpy as np

from paramreduce_cli.artifacts.log_files import load_recorded
from paramreduce_cli.config import load_config
from paramreduce_cli.identification import processing
from paramreduce_cli.identification.band_scoring import (
    Band,
    compute_rows,
    factorise_band,
    make_column_function,
)
from paramreduce_cli.identification.quality import find_base
from paramreduce_cli.identification.state_estimation import compute_edge
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import RawLogs
from paramreduce_cli.stages.process_log import process_logs_of_robot

_FACTORS = (0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20)
"""State cut-offs of the grid, over the chosen one."""


def split(config):
    """Rate, training pieces and held-out pieces of a config's log, as recorded."""
    section = config.sampling.log
    logs = [load_recorded(parts, section.columns.time) for parts in section.training_files]
    names = config.build_mechanism().coordinate_names
    files = processing._read_files(logs, section, names, config.unmeasured, [])
    parts = processing._split_files(files.motions, [], section)
    return files.rate, *([piece for part in pieces for piece in part] for pieces in parts)


def fit(band: Band):
    squares = np.sum(band.factors[..., -1] ** 2, axis=(0, 2)) / band.n_samples
    noise = estimate_joint_noise(band.factors, np.sqrt(squares), band.n_samples)
    return solve_least_squares(combine_factors(band.factors, noise))


def main(paths):
    warnings.simplefilter("ignore")
    for path in paths:
        config = load_config(Path(path))
        dynamics = Dynamics(config.build_mechanism(), once=True)
        section = config.sampling.log
        logs = [load_recorded(parts, section.columns.time) for parts in section.training_files]
        search = process_logs_of_robot(dynamics, config, section, RawLogs(logs, ())).search
        measured = config.find_measured()
        columns = make_column_function(dynamics, find_base(dynamics, measured).columns)
        rate, training, held_out = split(config)
        lowest = min(_FACTORS) * search.state
        found = {}
        for state in [factor * search.state for factor in _FACTORS]:
            if state > 0.4 * rate:
                continue
            rows = [
                compute_rows(pieces, rate, state, search.bands[-1], columns,
                             np.array([compute_edge(piece, rate, lowest) for piece in pieces]), folds)
                for pieces, folds in ((training, section.folds), (held_out, 1))
            ]  # fmt: skip
            scored = factorise_band(rows[1], search.scored, 1)
            for band in search.bands:
                values = fit(factorise_band(rows[0], float(band), section.folds))
                error = scored.compute_left([values], measured) / scored.compute_power(measured)
                found[state, float(band)] = float(np.sqrt(error))
        own = found[search.state, search.torque]
        best = min(found, key=found.get)
        print(f"{path}: {100 * own:.3g} % at {search.state:.3g} / {search.torque:.3g} Hz, best of {len(found)} pairs "
              f"{100 * found[best]:.3g} % at {best[0]:.3g} / {best[1]:.3g} Hz: {own / found[best]:.3f}")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])

"""The stage identify: parameters from measured torques, their uncertainty, and hints."""

import warnings

import numpy as np

from paramreduce_cli.config.identification import IdentificationSection
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.identification import consistency as physics
from paramreduce_cli.identification.estimation import LinearFit, collect_rows, fit_robustly
from paramreduce_cli.identification.hints import find_hints
from paramreduce_cli.identification.model_comparison import compare_held_out
from paramreduce_cli.identification.payload_estimation import (
    find_payload_hints,
    list_payload_columns,
)
from paramreduce_cli.identification.state_noise import hint_at_state_noise, predict_shifts
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.noise import estimate_joint_noise
from paramreduce_cli.multibody.observation import combine_factors
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import (
    INERTIAL,
    Block,
    Consistency,
    Estimate,
    FloatArray,
    Identification,
    MeasuredLog,
    Model,
    Progress,
    ProgressCallback,
    ReducedModel,
    Samples,
    SampleSet,
    Validation,
)
from paramreduce_cli.reduction.models import make_base_model

_STEPS = 3
_MOST_SHOWN = 1500
"""Samples in figures."""


def identify(
    identification: IdentificationSection,
    log: MeasuredLog | None,
    model: Model,
    samples: Samples,
    validation: Validation,
    report_progress: ProgressCallback = lambda _: None,
) -> Identification:
    """Identify base parameters and those of the selected model, with standard deviations.

    The stage also finds physically consistent standard parameters, and gives hints if residuals are more than noise.

    Raises:
        DataError: The samples have no validation set.
    """
    if samples.validation is None:
        raise DataError("samples.h5 holds no validation set.", command="sample")
    training, held_out = samples.estimation, samples.validation
    factors, n_samples = training.compute_factors(), training.n_samples
    scale = np.where(np.isfinite(model.nominal_torque), _compute_torque_rms(training), np.inf)
    deviation = np.where(np.isfinite(scale), 1.0, np.inf)
    if identification.estimator != "ordinary":
        deviation = estimate_joint_noise(factors, scale, n_samples)
    base, chosen = make_base_model(model), validation.selected.model
    known = np.zeros(model.values.size)
    full, full_fit = _estimate_parameters(
        identification, base.names, _make_expansion(base), known, samples, deviation
    )
    report_progress(Progress("identification", 1, _STEPS, "base parameters"))
    reduced, _ = _estimate_parameters(
        identification, chosen.names, _make_expansion(chosen), known, samples, deviation
    )
    payload = _estimate_payload(identification, model, samples, deviation)
    report_progress(Progress("identification", 2, _STEPS, "selected parameters"))
    consistency = _fit_consistent(identification, model, samples, deviation)
    hints = find_hints(model, training, full, full_fit, consistency, log)
    if log is not None:
        dynamics = Dynamics(model.mechanism, once=True)
        shifts = predict_shifts(log, dynamics, _make_expansion(base), factors, deviation)
        hints += hint_at_state_noise(full.names, log.state_cutoff, shifts / full.deviations)
    if payload is not None:
        hints += find_payload_hints(model.mechanism, identification.payloads, payload, full)
    for text in hints:
        warnings.warn(text.rstrip("."), ParamreduceWarning, stacklevel=2)
    shown = _take_first_samples(held_out)
    report_progress(Progress("identification", _STEPS, _STEPS))
    return Identification(
        estimator=identification.estimator,
        torque_deviation=deviation,
        torque_size=_compute_torque_rms(held_out),
        full=full,
        reduced=reduced,
        payload=payload,
        residuals=full_fit.analyse_residuals(n_samples),
        consistency=consistency,
        hints=tuple(hints),
        comparison=compare_held_out(full, reduced),
        shown_time=np.concatenate([block.time for block in shown]),
        shown_measured=np.concatenate([block.tau for block in shown]),
        shown_full=_predict_torques(shown, full.standard),
        shown_reduced=_predict_torques(shown, reduced.standard),
    )


def _make_expansion(chosen: ReducedModel) -> FloatArray:
    """Return the matrix that expresses a model's columns by those of the standard parameters, (n_standard, n)."""
    columns = np.zeros((chosen.position.size, chosen.n))
    columns[chosen.kept, chosen.position[chosen.kept]] = 1.0
    return columns


def _merge_factors(
    factors: FloatArray, columns: FloatArray, known_values: FloatArray
) -> FloatArray:
    """Return the factors of [W columns | tau - W known] by trajectory and joint."""
    W = factors[..., :-1]
    rest = factors[..., -1] - W @ known_values
    return np.concatenate([W @ columns, rest[..., None]], axis=-1)


def _estimate_parameters(
    section: IdentificationSection,
    names: tuple[str, ...],
    columns: FloatArray,
    known_values: FloatArray,
    samples: Samples,
    deviation: FloatArray,
) -> tuple[Estimate, LinearFit]:
    """Return the identified parameters of a model, and their fit.

    Args:
        section: Settings.
        names: Names of the parameters.
        columns: Matrix that expresses the model's columns by those of the standard parameters, (n_standard, n).
        known_values: Standard parameters whose torques are subtracted, zero for those to be identified, (n_standard,).
        samples: Samples.
        deviation: Divisor of the torques of each joint, (n_dof,).
    """
    training, held_out = samples.estimation, samples.validation
    assert held_out is not None
    whole = training.compute_factors()
    factors = _merge_factors(whole, columns, known_values)
    values = solve_least_squares(combine_factors(factors, deviation))
    if section.estimator == "robust":
        values, deviation = fit_robustly(
            lambda: (
                (
                    (b.W @ columns).reshape(*b.tau.shape, -1),
                    b.tau - (b.W @ known_values).reshape(b.tau.shape),
                )
                for b in training.iterate_blocks()
            ),
            values,
            deviation,
        )
    rows = collect_rows(training.iterate_blocks(), columns, known_values, training.n_samples)
    fitted = LinearFit(rows, values, deviation)
    standard = known_values + columns @ values
    own, other = (_compute_errors(part, standard, deviation) for part in (training, held_out))
    estimate = Estimate(
        names=names,
        values=values,
        deviations=np.sqrt(np.maximum(0.0, np.diag(fitted.compute_covariance()))),
        half_widths=fitted.compute_half_widths(),
        standard=standard,
        train=own[0],
        held_out=other[0],
        joint_train=own[1],
        joint_held_out=other[1],
        folds=_cross_validate(factors, np.linalg.norm(whole[..., -1], axis=2), deviation),
    )
    return estimate, fitted


def _estimate_payload(
    section: IdentificationSection, model: Model, samples: Samples, deviation: FloatArray
) -> Estimate | None:
    """Return the identified parameters of payloads alone, or None if the config names none."""
    if not section.payloads:
        return None
    factor = combine_factors(samples.estimation.compute_factors(), deviation)
    parameters = model.mechanism.parameters
    indices = list_payload_columns(model.mechanism, model.values, section.payloads, factor)
    if not any(parameters[k].kind in INERTIAL for k in indices):
        listed = " and ".join(section.payloads)
        warnings.warn(
            f"the torques do not depend on the payload {listed}, so it is not identified alone",
            ParamreduceWarning,
            stacklevel=2,
        )
        return None
    columns = np.eye(model.values.size)[:, indices]
    known = model.values.copy()
    known[indices] = 0.0
    names = tuple(parameters[k].name for k in indices)
    return _estimate_parameters(section, names, columns, known, samples, deviation)[0]


def _compute_errors(
    part: SampleSet, standard: FloatArray, deviation: FloatArray
) -> tuple[float, FloatArray]:
    """Return the norm of the residuals of all measured joints relative to that of their torques, unweighted, and the
    root mean square residual of each joint, (n_dof,), NaN for joints that are not measured.
    """
    measured = np.isfinite(deviation)
    left, whole = np.zeros(measured.size), np.zeros(measured.size)
    for block in part.iterate_blocks():
        residual = block.tau - (block.W @ standard).reshape(block.tau.shape)
        left += np.sum(residual**2, axis=0)
        whole += np.sum(block.tau**2, axis=0)
    joints = np.where(measured, np.sqrt(left / part.n_samples), np.nan)
    return float(np.sqrt(left[measured].sum() / whole[measured].sum())), joints


def _cross_validate(factors: FloatArray, norms: FloatArray, deviation: FloatArray) -> FloatArray:
    """Return the error on each fold of a fit without that fold; nothing if there is only one.

    Args:
        factors: Triangular factors by fold and joint, (n_folds, n_dof, n + 1, n + 1).
        norms: Norms of the torques, (n_folds, n_dof).
        deviation: Divisor of the torques of each joint, (n_dof,).
    """
    measured = np.isfinite(deviation)
    found = []
    for k in range(len(factors) if len(factors) > 1 else 0):
        values = solve_least_squares(combine_factors(np.delete(factors, k, axis=0), deviation))
        own = factors[k, measured]
        left = own[..., -1] - own[..., :-1] @ values
        found.append(np.linalg.norm(left) / (np.linalg.norm(norms[k, measured]) or 1.0))
    return np.array(found)


def _compute_torque_rms(part: SampleSet) -> FloatArray:
    """Return the root mean squares of the torques, (n_dof,)."""
    total = np.sum([np.sum(block.tau**2, axis=0) for block in part.iterate_blocks()], axis=0)
    return np.where(total > 0, np.sqrt(total / part.n_samples), 1.0)


def _fit_consistent(
    section: IdentificationSection, model: Model, samples: Samples, deviation: FloatArray
) -> Consistency | None:
    """Return the physically consistent parameters, or None if the config asks for none."""
    if section.consistency == "none":
        return None
    held_out = samples.validation
    assert held_out is not None
    factor = combine_factors(samples.estimation.compute_factors(), deviation)
    known = physics.list_constraints(model.mechanism, model.values, factor)
    try:
        standard = physics.fit_consistent(factor, known, section.consistency)
    except DataError as error:
        warnings.warn(
            f"{str(error).rstrip('.')}; going on without", ParamreduceWarning, stacklevel=2
        )
        return None
    except ImportError:
        warnings.warn(
            "physical consistency is not checked, because cvxpy is missing; "
            "`pip install 'paramreduce[identify]'` installs it",
            ParamreduceWarning,
            stacklevel=2,
        )
        return None
    drives = standard[known.positive]
    return Consistency(
        standard=standard,
        train=_compute_errors(samples.estimation, standard, deviation)[0],
        held_out=_compute_errors(held_out, standard, deviation)[0],
        smallest_eigenvalues=physics.compute_smallest_eigenvalues(known, standard),
        unconstrained_eigenvalues=physics.compute_smallest_eigenvalues(
            known, physics.fit_unconstrained(factor, known)
        ),
        bodies=known.names,
        smallest_drive=float(drives.min()) if drives.size else np.inf,
    )


def _take_first_samples(part: SampleSet) -> list[Block]:
    """Return the first samples of a set, for figures."""
    found: list[Block] = []
    for block in part.iterate_blocks():
        if block.trajectory != 0 or sum(b.time.size for b in found) >= _MOST_SHOWN:
            break
        found.append(block)
    return found


def _predict_torques(blocks: list[Block], standard: FloatArray) -> FloatArray:
    return np.concatenate([(b.W @ standard).reshape(b.tau.shape) for b in blocks])

"""A paragraph for papers that says what was done, and what to cite for it."""

from collections.abc import Iterator
from math import isfinite

import numpy as np

from paramreduce_cli import __version__
from paramreduce_cli.records import (
    ErrorRange,
    Identification,
    MeasuredLog,
    SelectionMethod,
    TermReduction,
    Trajectories,
)
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.texts import format_percent, format_percent_range

_BIBTEX = {
    "Atkeson1986": ("article", "C. G. Atkeson and C. H. An and J. M. Hollerbach",
                    "Estimation of inertial parameters of manipulator loads and links",
                    "journal = {International Journal of Robotics Research}, volume = {5}, number = {3}", 1986),
    "Furnival1974": ("article", "G. M. Furnival and R. W. Wilson", "Regressions by leaps and bounds",
                     "journal = {Technometrics}, volume = {16}, number = {4}", 1974),
    "Gautier1991": ("article", "M. Gautier",
                    "Numerical calculation of the base inertial parameters of robots",
                    "journal = {Journal of Robotic Systems}, volume = {8}, number = {4}", 1991),
    "Gautier1997": ("inproceedings", "M. Gautier", "Dynamic identification of robots with power model",
                    "booktitle = {IEEE International Conference on Robotics and Automation}", 1997),
    "Hastie2009": ("book", "T. Hastie and R. Tibshirani and J. Friedman",
                   "The Elements of Statistical Learning", "edition = {2}, publisher = {Springer}", 2009),
    "Luh1980": ("article", "J. Y. S. Luh and M. W. Walker and R. P. C. Paul",
                "On-line computational scheme for mechanical manipulators",
                "journal = {Journal of Dynamic Systems, Measurement, and Control}, volume = {102}, number = {2}", 1980),
    "Pham1991": ("inproceedings", "C. M. Pham and M. Gautier", "Essential parameters of robots",
                 "booktitle = {IEEE Conference on Decision and Control}", 1991),
    "Pudil1994": ("article", r"P. Pudil and J. Novovi{\v c}ov{\'a} and J. Kittler",
                  "Floating search methods in feature selection",
                  "journal = {Pattern Recognition Letters}, volume = {15}, number = {11}", 1994),
    "Ros2019": ("misc", "J. Ros and X. Iriarte and A. Plaza and V. Mata",
                "Simplification of multibody models by parameter reduction", "", 2019),
    "Swevers1996": ("article", "J. Swevers and C. Ganseman and J. De Schutter and H. Van Brussel",
                    "Experimental robot identification using optimised periodic trajectories",
                    "journal = {Mechanical Systems and Signal Processing}, volume = {10}, number = {5}", 1996),
}  # fmt: skip
"""Kind, authors, title, where and year of what is cited."""

_SOFTWARE = (
    "@software{paramreduce,\n  author = {{The paramreduce developers}},\n  title = {paramreduce},\n"
    f"  version = {{{__version__}}}\n}}"
)
"""What made the page."""

_HEURISTICS = {"qr": "Ros2019", "forward-selection": "Ros2019", "forward-selection-2": "Ros2019",
               "backward-elimination": "Ros2019", "floating": "Pudil1994", "essential": "Pham1991"}  # fmt: skip
"""Where heuristics were published."""


def write_methods(data: ReportData) -> tuple[str, str]:
    """Return a paragraph on the method, with keys in brackets, and the BibTeX entries of these keys."""
    text = " ".join(_write_sentences(data))
    cited = [key for key in _BIBTEX if f"{key}]" in text or f"{key}," in text]
    return text, "\n\n".join([*(_write_entry(key) for key in cited), _SOFTWARE])


def _write_sentences(data: ReportData) -> Iterator[str]:
    """Yield the sentences of the paragraph, in order."""
    if data.model is not None:
        yield from _write_model(data)
    yield from _write_excitation(data)
    yield from _write_selection(data)
    yield from _write_result(data)
    if data.terms is not None:
        yield from _write_terms(data.terms)
    if data.identification is not None:
        yield from _write_identification(data.identification)
    yield f"All of this was done by paramreduce {__version__} [paramreduce]."


def _write_model(data: ReportData) -> Iterator[str]:
    """Yield the sentences on the model."""
    model = data.robot_model
    mechanism = model.mechanism
    freedom = f"{mechanism.n_dof} degree{'s' if mechanism.n_dof > 1 else ''} of freedom"
    loops = ", closed kinematic loops" if mechanism.loops is not None else ""
    yield (
        f"The rigid-body model of the robot ({freedom}{loops}) is linear in its {model.values.size} standard dynamic "
        f"parameters [Atkeson1986], {data.n_affecting} of which act on the generalised forces."
    )
    yield (
        f"A numerical rank analysis [Gautier1991] gives {model.base.columns.size} base parameters."
    )


def _write_excitation(data: ReportData) -> Iterator[str]:
    """Yield the sentences on the motions."""
    if data.log is not None:
        yield _write_log(data.log)
    elif data.trajectories is not None:
        yield _write_trajectories(data.trajectories)
    elif data.model is None:
        yield "The observation matrix and the forces were given."
    elif data.simulated:
        yield "The states of all sets are those of simulated motions of the full model."
    else:
        yield "The states of all sets were given."


def _write_log(log: MeasuredLog) -> str:
    """Return the sentence on recorded motions."""
    states = "differentiated positions" if not isfinite(log.state_cutoff) else (
        f"positions and speeds low-passed at {log.state_cutoff:.4g} Hz"
    )  # fmt: skip
    torques = "were taken as recorded"
    if isfinite(log.torque_cutoff):
        torques = (
            f"and the observation matrix were low-passed alike at {log.torque_cutoff:.4g} Hz "
            "[Gautier1997]"
        )
    return (
        f"Motion and torques were recorded at {log.recorded_rate:.4g} Hz; states are {states}, torques {torques}; what was "
        "held out took no part in any fit."
    )


def _write_trajectories(trajectories: Trajectories) -> str:
    """Return the sentences on optimised trajectories."""
    count = f"{len(trajectories.estimation)} estimation, {len(trajectories.validation)} validation and {len(trajectories.test)} test trajectories"
    if trajectories.source:
        return f"Finite Fourier series [Swevers1996] were given for {count} of {trajectories.period:.4g} s."
    limits = trajectories.limits
    kinds = {"velocity": limits.velocity, "acceleration": limits.acceleration,
             "torque": limits.torque, "power": limits.power}  # fmt: skip
    kept = ["position", *(kind for kind, values in kinds.items() if np.isfinite(values).any())]
    bounded = (
        f" and {len(trajectories.constraints)} bounded quantities"
        if trajectories.constraints
        else ""
    )
    kappas = [t.kappa for t in trajectories.estimation]
    return (
        f"{count[0].upper()}{count[1:]} of {trajectories.period:.4g} s, finite Fourier series [Swevers1996] within limits of "
        f"{', '.join(kept)}{bounded}, were optimised by the {trajectories.criterion} criterion of the {trajectories.scaling} observation "
        f"matrix; condition numbers of single estimation trajectories are {min(kappas):.3g} to {max(kappas):.3g}."
    )


_WEIGHTS = {
    "nominal-torque": "each joint's residuals over its nominal torque",
    "noise": "each joint's residuals over its noise",
    "none": "unweighted",
}


def _write_selection(data: ReportData) -> Iterator[str]:
    """Yield the sentences on the heuristics."""
    names = list(data.reduction.heuristics)
    cited = []
    for name in names:
        key = _HEURISTICS.get(SelectionMethod.parse(name).heuristic)
        cited.append(f"{name} [{key}]" if key else name)
    yield f"Subsets of parameters were selected by {', '.join(cited)}."
    yield (
        "Values of the parameters that are kept are those of least squares on the torques of the estimation set, "
        f"{_WEIGHTS[data.weighting]} [Ros2019]."
    )
    if any(SelectionMethod.parse(name).criterion == "acceleration" for name in names):
        yield "Those selected by acceleration (@acceleration) are fitted to the accelerations instead."
    proofs = data.reduction.proofs
    if proofs is not None:
        yield (
            "A branch-and-bound search [Furnival1974], with bounds and rules of its own, proved the best subset by torque "
            f"error for {proofs.n_proven} of {proofs.n_provable} sizes up to the rank."
        )
    if data.validation.cross_validation:
        yield "The size was chosen by cross-validation inside the estimation set [Hastie2009], Sec. 7.10."


def _write_result(data: ReportData) -> Iterator[str]:
    """Yield the sentences on the selected model."""
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    row = result.find_row(selected.n)
    errors = [f"{format_percent(float(result.torque_error.estimation[row]))} on the estimation set"]
    if "validation" in data.rms_torque:
        errors.append(
            f"{format_percent(float(result.torque_error.validation[row]))} on the validation set"
        )
    test = result.torque_error.test[row]
    if test.size:
        errors.append(
            f"{format_percent_range(*ErrorRange.summarise(test))} on {test.size} motions that no search has looked at"
        )
    yield f"The model with {selected.n} parameters of {selected.heuristic} has a relative torque error of {', '.join(errors)}."
    if data.model is not None:
        full = data.validation.full["operations_inverse"]
        reduced = int(result.operations.inverse[row])
        yield (
            f"Its inverse dynamics, recursive Newton-Euler equations [Luh1980] simplified symbolically, takes {reduced} "
            f"operations instead of {full:.0f}{_COUNTED[data.functions[0]]}, parameters being inputs."
        )


_COUNTED = {
    "d": "",
    "d_q": " for the open tree, the projection on the loops and their solution left out",
    "d_z": ", the solution of the loops left out",
}
"""What is counted, by the function."""


def _write_terms(terms: TermReduction) -> Iterator[str]:
    """Yield the sentences on pruned functions."""
    for name, term in terms.functions.items():
        acceleration = ""
        if name == "direct" and isfinite(terms.acceleration_budget):
            acceleration = (
                f" and an acceleration error of {format_percent(terms.acceleration_budget)}"
            )
        yield (
            f"Terms of the {name} dynamics that hardly matter were left out or replaced by multiples of others, and the "
            f"{term.values.size} parameters fitted again "
            f"within a torque error of {format_percent(terms.torque_budget)}{acceleration}: {term.operations} operations instead of "
            f"the {term.operations_start} of {term.heuristic} with {term.n_start} parameters, from which it began."
        )


_ESTIMATORS = {
    "ordinary": "ordinary least squares",
    "weighted": "least squares weighted by the noise of each joint",
    "robust": "iteratively reweighted least squares",
}


def _write_identification(identification: Identification) -> Iterator[str]:
    """Yield the sentences on identified values."""
    yield (
        f"Values were identified from the measured torques by {_ESTIMATORS[identification.estimator]}, with standard deviations for "
        f"noise as coloured as the residuals; {format_percent(identification.reduced.held_out)} of the torques held out stay unexplained, "
        f"{format_percent(identification.full.held_out)} with all base parameters."
    )
    if identification.consistency is not None:
        yield (
            "Standard parameters that a machine can have were found under constraints on the bodies' pseudo-inertia "
            f"matrices and leave {format_percent(identification.consistency.held_out)}."
        )


def _write_entry(key: str) -> str:
    """Return a BibTeX entry."""
    kind, authors, title, where, year = _BIBTEX[key]
    lines = [f"author = {{{authors}}}", f"title = {{{title}}}", *([where] if where else []), f"year = {{{year}}}"]  # fmt: skip
    return f"@{kind}{{{key},\n  " + ",\n  ".join(lines) + "\n}"

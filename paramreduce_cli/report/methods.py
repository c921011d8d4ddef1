"""A paragraph for papers that says what was done, and what to cite for it."""

from collections.abc import Iterator

from paramreduce_cli.records import ProofStatus, SelectionMethod
from paramreduce_cli.report.data import ReportData

_BIBTEX = {
    "Atkeson1986": ("article", "C. G. Atkeson and C. H. An and J. M. Hollerbach",
                    "Estimation of inertial parameters of manipulator loads and links",
                    "journal = {International Journal of Robotics Research}, volume = {5}, number = {3}", 1986),
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

_HEURISTICS = {"qr": "Ros2019", "forward-selection": "Ros2019", "forward-selection-2": "Ros2019",
               "backward-elimination": "Ros2019", "floating": "Pudil1994", "essential": "Pham1991"}  # fmt: skip
"""Where heuristics were published."""


def methods(data: ReportData) -> tuple[str, str]:
    """The paragraph, with keys in brackets, and the BibTeX entries of these."""
    text = " ".join(_sentences(data))
    cited = [key for key in _BIBTEX if f"{key}]" in text or f"{key}," in text]
    return text, "\n\n".join(_entry(key) for key in cited)


def _sentences(data: ReportData) -> Iterator[str]:
    if data.known_model is not None:
        yield from _model(data)
    yield from _excitation(data)
    yield from _selection(data)
    yield from _result(data)


def _model(data: ReportData) -> Iterator[str]:
    model = data.model
    mechanism = model.mechanism
    loops = ", with closed kinematic loops," if mechanism.loops is not None else ""
    yield (
        f"The rigid-body model of the robot ({mechanism.n_dof} degrees of freedom{loops}) is linear in its "
        f"{model.values.size} standard dynamic parameters [Atkeson1986], {data.n_affecting} of which act on the "
        f"generalised forces."
    )
    yield (
        f"A numerical rank analysis [Gautier1991] gives {model.base.columns.size} base parameters."
    )


def _excitation(data: ReportData) -> Iterator[str]:
    trajectories = data.trajectories
    if data.log is not None:
        yield (
            f"Torques were measured at {data.log.recorded_rate:.4g} Hz; the same filter was applied to them and to the "
            f"observation matrix [Gautier1997], and part of the motion was held out."
        )
        return
    if trajectories is None:
        yield "The observation matrix and the forces were given."
        return
    count = f"{len(trajectories.estimation)} estimation and {len(trajectories.validation)} validation trajectories"
    if trajectories.source:
        yield f"Finite Fourier series [Swevers1996] were given for {count} of {trajectories.period:.4g} s."
    else:
        kappas = [t.kappa for t in trajectories.estimation]
        yield (
            f"{count[0].upper()}{count[1:]} of {trajectories.period:.4g} s, finite Fourier series [Swevers1996] within "
            f"limits of position, velocity and acceleration, were optimised for the {trajectories.criterion} criterion "
            f"of the {trajectories.scaling} observation matrix; condition numbers of the estimation set are "
            f"{min(kappas):.3g} to {max(kappas):.3g}."
        )


def _selection(data: ReportData) -> Iterator[str]:
    names = [SelectionMethod.parse(name).heuristic for name in data.reduction.heuristics]
    cited = [f"{n} [{_HEURISTICS[n]}]" if n in _HEURISTICS else n for n in dict.fromkeys(names)]
    yield (
        "Subsets of parameters of every size were selected by "
        f"{', '.join(cited)}, and the values of those that are kept fitted by least squares on the estimation set, each "
        "joint's residuals over its nominal torque [Ros2019]."
    )
    proofs = data.reduction.proofs
    if proofs is not None:
        proven = sum(status is ProofStatus.OPTIMAL for status in proofs.status)
        yield (
            f"A branch-and-bound search proved the best subset by torque error for {proven} of the {proofs.n.size} sizes."
        )
    if data.validation.cross_validation:
        yield "The size was chosen by cross-validation inside the estimation set with the one-standard-error rule [Hastie2009]."


def _result(data: ReportData) -> Iterator[str]:
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    row = result.row(selected.n)
    errors = [f"{100 * result.torque_error_estimation[row]:.3g} % on the estimation set"]
    if "validation" in data.rms_torque:
        errors.append(f"{100 * result.torque_error_validation[row]:.3g} % on the validation set")
    yield f"The model with the {selected.n} parameters of {selected.heuristic} has a relative torque error of {' and '.join(errors)}."
    if data.known_model is not None:
        full, reduced = (data.validation.full["operations_inverse"], result.operations_inverse[row])
        yield (
            f"Its inverse dynamics, recursive Newton-Euler equations [Luh1980] simplified symbolically, takes {reduced} "
            f"operations instead of {full:.0f}, parameters being inputs."
        )


def _entry(key: str) -> str:
    kind, authors, title, where, year = _BIBTEX[key]
    lines = [f"author = {{{authors}}}", f"title = {{{title}}}", *([where] if where else []), f"year = {{{year}}}"]  # fmt: skip
    return f"@{kind}{{{key},\n  " + ",\n  ".join(lines) + "\n}"

"""One exciting trajectory: random starts, a smooth objective that sharpens, the best kept.

All starts go through the blunt levels; the most promising ones through the sharp levels,
with IPOPT's stopping rules tightened. The numbers were chosen by measurement, on serial arms
for motions that only keep joint limits, on a parallel robot with six legs for those with bounds or loops.

With loops, coordinates are mixed so that equal steps move the whole mechanism equally far:
left to themselves, some combinations of slides of a parallel robot would turn its platform
ten times as far as others, and neither random starts nor the solver would find their way.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import Concern, ConcernError, DataError, ParamreduceError
from paramreduce_cli.excitation.feasibility import drawn_inside, feasible_start, resting_position
from paramreduce_cli.excitation.fourier import FINER, FourierBasis, fourier_basis, sample_times
from paramreduce_cli.excitation.ipopt import LOOSE, TIGHT, minimise
from paramreduce_cli.excitation.limits import LimitMap, Mapping
from paramreduce_cli.excitation.objective import Excitation, FreeObjective, Level
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.records import FloatArray, JointLimits, Trajectory


@dataclass(frozen=True)
class Plan:
    """The levels that all starts go through, and those that the best ones go on to."""

    screening: tuple[Level, ...]
    polishing: tuple[Level, ...]


FREE = Plan(
    (Level(4, 30, 30), Level(16, 80, 80)),
    (Level(16, 80, 80), Level(32, 150, 150), Level(64, 300, 300), Level(256, 1000, 1000)),
)
BOUNDED = Plan(
    # The limits stay as smooth as they are: sharper ones would change the series they map to.
    (Level(1, 80, 100, 0.1),),
    (Level(4, 80, 200, 0.01), Level(16, 80, 400, 0.001)),
)


@dataclass(frozen=True)
class Settings:
    """What is asked of every trajectory."""

    period: float
    """s"""
    harmonics: int
    points: int
    """Of the grid on which the criterion and the limits are evaluated."""
    limits: JointLimits
    mapping: Mapping
    starts: int
    polished: int
    """How many of the starts go on to the sharp levels."""
    max_iterations: int
    """Of IPOPT, per level."""
    scaling: str
    """Name of the scaling whose condition number is reported first."""

    def basis(self, finer: int = 1) -> FourierBasis:
        """The series on the grid, or on one so many times finer."""
        times = sample_times(self.period, finer * self.points)
        return fourier_basis(self.period, self.harmonics, times)


@dataclass
class _Candidate:
    free: FloatArray
    kappa_start: float
    value: float
    curvature: FloatArray | None
    iterations: int = 0
    status: str = ""


def optimise_trajectory(
    excitation: Excitation,
    settings: Settings,
    seed: list[int],
    progress: Callable[[float], None] = lambda share: None,
) -> Trajectory:
    """Find one exciting trajectory.

    Args:
        excitation: What is measured.
        settings: What is asked.
        seed: Of the random starts; the result depends on nothing else.
        progress: Told the share of the work done, 0 to 1.

    Raises:
        ConcernError: No motion keeps the bounds; says which one stops it.
    """
    started = time.process_time()
    search = _Search(excitation, settings)
    plan = search.plan
    steps = settings.starts * len(plan.screening) + settings.polished * len(plan.polishing)
    done = 0

    def descend(candidate: _Candidate, levels: tuple[Level, ...], rule: dict) -> None:
        nonlocal done
        for level in levels:
            search.descend(candidate, level, rule)
            done += 1
            progress(done / steps)

    candidates = []
    for start in range(settings.starts):
        candidate = search.start([*seed, start])
        descend(candidate, plan.screening, LOOSE)
        candidates.append(candidate)
    candidates.sort(key=lambda candidate: candidate.value)
    chosen = candidates[: settings.polished]
    results: list[tuple[_Candidate, FloatArray, float]] = []
    failures: list[ParamreduceError] = []
    for candidate in chosen:
        descend(candidate, plan.polishing, TIGHT)
        try:
            series = search.result(candidate)
            results.append((candidate, series, search.kappa(series)))
        except ParamreduceError as error:  # one of several may fail
            failures.append(error)
    if not results:
        if isinstance(failures[0], ConcernError):
            raise failures[0]
        raise ConcernError(str(failures[0]), Concern.REACH) from failures[0]
    best, series, _ = min(results, key=lambda result: result[2])
    return describe(
        excitation,
        settings,
        series,
        kappa_start=best.kappa_start,
        cpu_seconds=time.process_time() - started,
        iterations=sum(candidate.iterations for candidate in candidates),
        status=best.status,
    )


class _Search:
    """The search for one trajectory: its grid, limits, resting position and plan."""

    def __init__(self, excitation: Excitation, settings: Settings) -> None:
        self._excitation, self._settings = excitation, settings
        self._basis = settings.basis()
        self._limits = LimitMap(settings.limits, self._basis, settings.mapping)
        mechanism = excitation.coordinates.mechanism
        self._bounded = bool(excitation.quantities.constraints) or mechanism.loops is not None
        self.plan = BOUNDED if self._bounded else FREE
        self._rest = settings.limits.middle
        self._mixing = np.eye(mechanism.n_dof)
        if self._bounded:
            self._rest = resting_position(excitation, settings.limits, self._limits.margin)
            q = excitation.coordinates.positions(self._rest[None], None)
            R = excitation.coordinates.tangent(q)[0]
            values, vectors = np.linalg.eigh(R.T @ R)
            self._mixing = (vectors * np.sqrt(values[0] / values)) @ vectors.T

    def start(self, seed: list[int]) -> _Candidate:
        """A normal random series, scaled to its limits and drawn together to keep its bounds."""
        rng = np.random.default_rng(seed)
        limits = self._limits
        free = rng.normal(size=(limits.n_dof, limits.n_columns))
        if not self._bounded:  # on a scale of its own for every joint
            free[:, 1:] /= limits.shares(free)[:, None]
            return _Candidate(free, self.kappa(limits.scaled(free)), np.inf, None)
        free[:, 1:] /= limits.shares(self._mixing @ free).max()
        still = np.zeros_like(free)
        still[:, 0] = np.linalg.solve(self._mixing, limits.resting_offset(self._rest))
        level = self.plan.screening[0]
        free = feasible_start(free, still, self._objective(level))
        series, _ = limits.admissible(self._mixing @ free, level.limits)
        try:
            kappa = self.kappa(series)
        except DataError:  # closed on the grid, but not between its points
            kappa = np.inf
        return _Candidate(free, kappa, np.inf, None)

    def descend(self, candidate: _Candidate, level: Level, rule: dict) -> None:
        """Take a candidate through one level."""
        objective = self._objective(level)
        end = minimise(
            objective,
            candidate.free.ravel(),
            self._settings.max_iterations,
            candidate.curvature,
            rule,
        )
        candidate.free = end.x.reshape(candidate.free.shape)
        candidate.value = end.value
        candidate.curvature = end.curvature
        candidate.iterations += end.iterations
        candidate.status = end.status

    def _objective(self, level: Level) -> FreeObjective:
        positions = Follower(self._excitation.coordinates)
        return FreeObjective(
            self._excitation, self._basis, self._limits, level, positions, self._mixing
        )

    def result(self, candidate: _Candidate) -> FloatArray:
        """The candidate's series, exactly on its limits and inside its bounds."""
        if not self._bounded:
            return self._limits.scaled(candidate.free)
        series, _ = self._limits.admissible(
            self._mixing @ candidate.free, self.plan.polishing[-1].limits
        )
        return drawn_inside(self._excitation, series, self._rest, self._settings.basis(FINER))

    def kappa(self, series: FloatArray) -> float:
        """The condition number that the settings ask for."""
        _, q = fine_positions(self._excitation, self._settings, series)
        _, dz, ddz = self._basis.states(series)
        return self._excitation.condition_numbers(q[::FINER], dz, ddz)[self._settings.scaling]


def fine_positions(
    excitation: Excitation, settings: Settings, series: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Times and generalised coordinates on the grid on which bounds are checked.

    Raises:
        DataError: The loops cannot be closed along it.
    """
    fine = settings.basis(FINER)
    return fine.time, excitation.coordinates.positions(fine.states(series)[0], None)


def describe(
    excitation: Excitation,
    settings: Settings,
    coefficients: FloatArray,
    *,
    kappa_start: float,
    cpu_seconds: float,
    iterations: int,
    status: str,
) -> Trajectory:
    """Measure a trajectory: condition numbers, peaks, share of limits, bounded quantities.

    On the settings' grid, the bounded quantities on a finer one.

    Raises:
        DataError: The loops cannot be closed along it.
    """
    z, dz, ddz = settings.basis().states(coefficients)
    times, q = fine_positions(excitation, settings, coefficients)
    excitation.coordinates.check_motion(times, q)
    variants = excitation.condition_numbers(q[::FINER], dz, ddz)
    quantities = excitation.quantities.values(q)
    limits = settings.limits
    shares = [
        np.abs(z - (z.max(axis=0) + z.min(axis=0)) / 2) / limits.reach,
        np.abs(dz) / limits.velocity,
        np.abs(ddz) / limits.acceleration,
    ]
    return Trajectory(
        coefficients=coefficients,
        kappa=variants[settings.scaling],
        kappa_start=kappa_start,
        kappa_variants=variants,
        peak_position=np.abs(z - limits.middle).max(axis=0),
        peak_velocity=np.abs(dz).max(axis=0),
        reach=np.max([share.max(axis=0) for share in shares], axis=0),
        extremes=np.column_stack([quantities.min(axis=0), quantities.max(axis=0)]),
        cpu_seconds=cpu_seconds,
        iterations=iterations,
        status=status,
    )

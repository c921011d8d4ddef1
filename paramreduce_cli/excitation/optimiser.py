"""Optimiser of one exciting trajectory: random starts, a smooth objective that sharpens level by level.

Many starts are drawn and the best of them kept; level by level the objective sharpens and the
most promising go on, with IPOPT's stopping rules tightened at the end. The numbers were chosen by
measurement, on serial arms for motions that only keep joint limits, on a parallel robot with six legs for those with bounds or loops.

All levels but the last look at fewer points. A motion whose condition number is another one on all of
them, because it went through a singularity between the few, begins anew on all.

With loops, coordinates are mixed so that equal steps move the whole mechanism equally far:
left to themselves, some combinations of slides of a parallel robot would turn its platform
ten times as far as others, and neither random starts nor the solver would find their way.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import Cause, DataError, NumericalError, ParamreduceError
from paramreduce_cli.excitation.excitation_objective import Excitation, FreeObjective, Level
from paramreduce_cli.excitation.feasibility import (
    find_resting_position,
    shrink_inside_bounds,
    shrink_to_feasible,
)
from paramreduce_cli.excitation.fourier import FINER, FourierBasis, evaluate_basis, sample_times
from paramreduce_cli.excitation.ipopt import LOOSE, TIGHT, minimise
from paramreduce_cli.excitation.limits import LimitMap, LimitMapping
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.records import FloatArray, JointLimits, Trajectory

_ENOUGH = 25
"""Points for every harmonic that all levels but the last get by with."""
_ASTRAY = 0.25
"""Relative difference of the condition numbers on few and on all points beyond which a motion is not trusted."""


@dataclass(frozen=True)
class Step:
    """A step of a search: its level, and how many of the candidates take part."""

    level: Level
    fraction: float
    """Fraction of the starts beyond the polished ones: 1 for all starts, 0 for the polished ones alone."""
    rule: Mapping[str, float]
    """When IPOPT stops."""
    most: int = 1000
    """Iterations, if no fewer are asked for."""


@dataclass(frozen=True)
class Plan:
    """A plan of a search: its random starts and its steps."""

    drawn: int
    """Random series for every start; the best of them by the first level's objective are starts."""
    steps: tuple[Step, ...]


FREE = Plan(
    25,
    (
        Step(Level(4, 30, 30), 1.0, LOOSE, most=50),
        Step(Level(16, 80, 80), 0.5, LOOSE, most=80),
        Step(Level(32, 150, 150), 0.0, TIGHT, most=150),
        Step(Level(256, 1000, 1000), 0.0, TIGHT, most=200),
    ),
)
BOUNDED = Plan(
    # The limits stay as smooth as they are: sharper ones would change the series they map to.
    1,
    (
        Step(Level(1, 80, 100, 0.1), 1.0, LOOSE),
        Step(Level(4, 80, 200, 0.01), 0.0, TIGHT),
        Step(Level(16, 80, 400, 0.001), 0.0, TIGHT),
    ),
)
BOUNDED_TREE = Plan(
    # Without loops an iteration is cheap and the way to a good motion short.
    1,
    (
        Step(Level(1, 80, 100, 0.1), 1.0, LOOSE, most=80),
        Step(Level(4, 80, 200, 0.01), 0.0, TIGHT, most=150),
        Step(Level(16, 80, 400, 0.001), 0.0, TIGHT, most=150),
    ),
)


@dataclass(frozen=True)
class TrajectorySettings:
    """The settings for every trajectory."""

    period: float
    """s"""
    harmonics: int
    points: int
    """Number of points of the grid on which the criterion and the limits are evaluated, at the last level if no earlier."""
    limits: JointLimits
    mapping: LimitMapping
    rest_to_rest: bool
    """Whether motions begin and end without velocity and acceleration."""
    start_pose: FloatArray | None
    """Position to start the search for motions with bounds from; None for the middle of the limits."""
    starts: int
    """Number of series that are optimised at first."""
    polished: int
    """Number of these that continue to the sharp levels."""
    max_iterations: int
    """Largest number of IPOPT's iterations per level."""
    scaling: str
    """Name of the scaling whose condition number is reported first."""

    def count_candidates(self, fraction: float) -> int:
        """Return the number of candidates that take a step with this share."""
        return self.polished + round(fraction * (self.starts - self.polished))

    def build_basis(self, finer: int = 1) -> FourierBasis:
        """Return the basis of the series on the grid, or on a grid that is ``finer`` times as fine."""
        return self._build_basis_on(finer * self.points)

    def build_coarse_basis(self) -> FourierBasis:
        """Return the basis of the series on the coarse grid of all levels but the last."""
        return self._build_basis_on(_ENOUGH * self.harmonics)

    def _build_basis_on(self, points: int) -> FourierBasis:
        return evaluate_basis(self.period, self.harmonics, sample_times(self.period, points))


@dataclass(frozen=True)
class _Grid:
    """A grid of times with the limits on it."""

    basis: FourierBasis
    limits: LimitMap
    """Map to series that keep the limits of the independent coordinates on the grid."""


@dataclass
class _Candidate:
    """A candidate of the search, from its random start to its present series."""

    start: FloatArray
    """The free series that it began with."""
    free: FloatArray
    value: float
    """Value of the last objective."""
    curvature: FloatArray | None = None
    status: str = ""


def optimise_trajectory(
    excitation: Excitation, settings: TrajectorySettings, seed: list[int]
) -> Trajectory:
    """Find one exciting trajectory.

    Args:
        excitation: Excitation objective.
        settings: Settings of the trajectory.
        seed: Seed of the random starts; the result depends on nothing else.

    Raises:
        NumericalError: No motion keeps the bounds; the message names the bound that is exceeded.
    """
    started = time.process_time()
    search = _Search(excitation, settings)
    steps = search.plan.steps
    counts = [settings.count_candidates(step.fraction) for step in steps]
    candidates = search.draw_starts(seed)
    iterations = 0
    for step, count in zip(steps, counts, strict=True):
        candidates = sorted(candidates, key=lambda candidate: candidate.value)[:count]
        for candidate in candidates:
            iterations += search.take_step(candidate, step)
    results: list[tuple[_Candidate, FloatArray, float]] = []
    failures: list[ParamreduceError] = []
    for candidate in candidates:
        try:
            series = search.finish_series(candidate)
            results.append((candidate, series, search.compute_kappa(series)))
        except ParamreduceError as error:  # one of several may fail
            failures.append(error)
    if not results:
        if isinstance(failures[0], NumericalError):
            raise failures[0]
        raise NumericalError(str(failures[0]), Cause.REACH) from failures[0]
    best, series, _ = min(results, key=lambda result: result[2])
    return describe(
        excitation,
        settings,
        series,
        kappa_start=search.compute_start_kappa(best),
        cpu_seconds=time.process_time() - started,
        iterations=iterations,
        status=best.status,
    )


class _Search:
    """The search for one trajectory: its grid, limits, resting position and plan."""

    def __init__(self, excitation: Excitation, settings: TrajectorySettings) -> None:
        self._excitation, self._settings = excitation, settings
        self._grid = self._coarse = self._build_grid(settings.build_basis())
        if settings.points > _ENOUGH * settings.harmonics:
            self._coarse = self._build_grid(settings.build_coarse_basis())
        self._limits = self._grid.limits
        mechanism = excitation.coordinates.mechanism
        bounded = bool(excitation.quantities.constraints) or excitation.loads.limited
        self._bounded = bounded or mechanism.loops is not None
        self.plan = FREE
        if self._bounded:
            self.plan = BOUNDED_TREE if mechanism.loops is None else BOUNDED
        self._rest = settings.limits.middle
        self._mixing = np.eye(mechanism.n_dof)
        if self._bounded:
            self._rest = find_resting_position(
                excitation, settings.limits, self._limits.margin, settings.start_pose
            )
            q = excitation.coordinates.compute_positions(self._rest[None], None)
            R = excitation.coordinates.compute_tangent(q)[0]
            values, vectors = np.linalg.eigh(R.T @ R)
            self._mixing = (vectors * np.sqrt(values[0] / values)) @ vectors.T

    def _build_grid(self, basis: FourierBasis) -> _Grid:
        """Return the grid of a basis, with the limits on it."""
        settings = self._settings
        limits = LimitMap(
            settings.limits, basis, settings.mapping, rest_to_rest=settings.rest_to_rest
        )
        return _Grid(basis, limits)

    def draw_starts(self, seed: list[int]) -> list[_Candidate]:
        """Return random Fourier series, each with its objective in the first step of the plan."""
        result = []
        for start in range(self._settings.starts * self.plan.drawn):
            free = self._draw_series(np.random.default_rng([*seed, start]))
            value, _ = self._build_objective(self._coarse, self.plan.steps[0].level)(free.ravel())
            result.append(_Candidate(free, free, value if np.isfinite(value) else np.inf))
        return result

    def _draw_series(self, rng: np.random.Generator) -> FloatArray:
        """Return a normally distributed random series, scaled to its limits and shrunk until it keeps its bounds."""
        limits = self._limits
        free = rng.normal(size=(limits.n_dof, limits.n_columns))
        if not self._bounded:  # on a scale of its own for every joint
            free[:, 1:] /= limits.compute_ratios(free)[:, None]
            return free
        free[:, 1:] /= limits.compute_ratios(self._mixing @ free).max()
        still = np.zeros_like(free)
        still[:, 0] = np.linalg.solve(self._mixing, limits.compute_resting_offset(self._rest))
        return shrink_to_feasible(
            free, still, self._build_objective(self._grid, self.plan.steps[0].level)
        )

    def compute_start_kappa(self, candidate: _Candidate) -> float:
        """Return the condition number of a candidate's random start."""
        if not self._bounded:
            return self.compute_kappa(self._limits.scale_to_limits(candidate.start))
        norm = self.plan.steps[0].level.limits
        try:
            return self.compute_kappa(
                self._limits.map_to_admissible(self._mixing @ candidate.start, norm)[0]
            )
        except DataError:  # closed on the grid, but not between its points
            return np.inf

    def take_step(self, candidate: _Candidate, step: Step) -> int:
        """Optimise a candidate in place for one step of the plan, and return the number of iterations."""
        if step is not self.plan.steps[-1]:
            return self._minimise(candidate, step, self._coarse)
        iterations = 0
        if self._is_astray(candidate):
            candidate.free, candidate.curvature = candidate.start, None
            for earlier in self.plan.steps[:-1]:
                iterations += self._minimise(candidate, earlier, self._grid)
        return iterations + self._minimise(candidate, step, self._grid)

    def _is_astray(self, candidate: _Candidate) -> bool:
        """Return whether a candidate's condition number on all points differs from that on the coarse grid."""
        if self._coarse is self._grid:
            return False
        if not np.isfinite(candidate.value):  # no way was found from where it began
            return True
        few, many = self._coarse.basis, self._grid.basis
        level = self.plan.steps[-1].level
        if not np.isfinite(self._build_objective(self._grid, level)(candidate.free.ravel())[0]):
            return True
        series, _ = self._limits.map_to_admissible(self._mixing @ candidate.free, level.limits)
        try:
            ratio = self._compute_kappa_on(few, series) / self._compute_kappa_on(many, series)
        except DataError:  # closed on all points, but not on few, which may be others
            return True
        return not abs(ratio - 1) < _ASTRAY

    def _minimise(self, candidate: _Candidate, step: Step, grid: _Grid) -> int:
        """Minimise the objective of a step, starting from a candidate, and return the number of iterations."""
        end = minimise(
            self._build_objective(grid, step.level),
            candidate.free.ravel(),
            min(self._settings.max_iterations, step.most),
            candidate.curvature,
            step.rule,
        )
        candidate.free = end.x.reshape(candidate.free.shape)
        candidate.value = end.value
        candidate.curvature = end.curvature
        candidate.status = end.status
        return end.iterations

    def _build_objective(self, grid: _Grid, level: Level) -> FreeObjective:
        """Return what IPOPT minimises in a step of the plan: the criterion on a grid with its barrier, smoothed as the
        step's level says.
        """
        positions = Follower(self._excitation.coordinates)
        return FreeObjective(
            self._excitation, grid.basis, grid.limits, level, positions, self._mixing
        )

    def finish_series(self, candidate: _Candidate) -> FloatArray:
        """Return the candidate's series, exactly on its limits and inside its bounds."""
        if not self._bounded:
            return self._limits.scale_to_limits(candidate.free)
        series, _ = self._limits.map_to_admissible(
            self._mixing @ candidate.free, self.plan.steps[-1].level.limits
        )
        return shrink_inside_bounds(
            self._excitation, series, self._rest, self._settings.build_basis(FINER)
        )

    def compute_kappa(self, series: FloatArray) -> float:
        """Return the condition number of W along a series, in the scaling of the settings.

        Args:
            series: Coefficients of a Fourier series, (n_dof, 1 + 2 harmonics).
        """
        _, q = compute_fine_positions(self._excitation, self._settings, series)
        _, dz, ddz = self._grid.basis.evaluate(series)
        return self._excitation.compute_condition_numbers(q[::FINER], dz, ddz)[
            self._settings.scaling
        ]

    def _compute_kappa_on(self, basis: FourierBasis, series: FloatArray) -> float:
        """Return the condition number of a series on the grid of a basis."""
        z, dz, ddz = basis.evaluate(series)
        q = self._excitation.coordinates.compute_positions(z, None)
        return self._excitation.compute_condition_numbers(q, dz, ddz)[self._settings.scaling]


def compute_fine_positions(
    excitation: Excitation, settings: TrajectorySettings, series: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return times and generalised coordinates along a trajectory, on the fine grid on which bounds are checked.

    Args:
        excitation: Robot, with its coordinates and bounds.
        settings: Settings with the period and the number of points.
        series: Coefficients of the trajectory's Fourier series.

    Raises:
        DataError: The loops cannot be closed along it.
    """
    fine = settings.build_basis(FINER)
    return fine.time, excitation.coordinates.compute_positions(fine.evaluate(series)[0], None)


def describe(
    excitation: Excitation,
    settings: TrajectorySettings,
    coefficients: FloatArray,
    *,
    kappa_start: float,
    cpu_seconds: float,
    iterations: int,
    status: str,
) -> Trajectory:
    """Compute the figures of a trajectory: condition numbers, peaks, fractions of limits, and bounded quantities.

    Bounded quantities are evaluated on a grid finer than that of the settings.

    Raises:
        DataError: The loops cannot be closed along it.
    """
    z, dz, ddz = settings.build_basis().evaluate(coefficients)
    times, q = compute_fine_positions(excitation, settings, coefficients)
    excitation.coordinates.check_motion(times, q)
    variants = excitation.compute_condition_numbers(q[::FINER], dz, ddz)
    quantities = excitation.quantities.compute_values(q)
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
        peak_torque=excitation.compute_peak_torques(q[::FINER], dz, ddz),
        reach=np.max([fraction.max(axis=0) for fraction in shares], axis=0),
        extremes=np.column_stack([quantities.min(axis=0), quantities.max(axis=0)]),
        cpu_seconds=cpu_seconds,
        iterations=iterations,
        status=status,
    )

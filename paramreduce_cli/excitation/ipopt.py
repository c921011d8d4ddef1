"""Unconstrained minimisation by IPOPT [Waechter2006] with a dense quasi-Newton matrix.

The matrix is updated here (damped BFGS [Powell1978]) and handed to IPOPT as the Hessian of the
Lagrangian: on problems of some tens of variables that is twice as fast as its own
limited-memory update. Value and gradient come from one call and are kept for the point
last asked.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from paramreduce_cli.records import FloatArray

Objective = Callable[[FloatArray], tuple[float, FloatArray]]

_OPTIONS = {
    "print_time": False,
    "no_nlp_grad": True,
    "calc_lam_p": False,
    "calc_lam_x": False,
    "error_on_fail": False,
    "show_eval_warnings": False,
}
_IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "mu_strategy": "adaptive",
    "tol": 1e-4,
    "bound_relax_factor": 0.0,
    # There are no constraints: scaling and refining the linear system is lost time.
    "fast_step_computation": "yes",
    "mumps_scaling": 0,
    "mumps_permuting_scaling": 0,
}
_DAMPING = 0.2

LOOSE = {"acceptable_tol": 1e-2, "acceptable_iter": 5, "acceptable_obj_change_tol": 1e-4}
"""Stop early: for comparing starts."""
TIGHT = {"acceptable_tol": 1e-3, "acceptable_iter": 15, "acceptable_obj_change_tol": 1e-6}
"""Stop late: for a start worth polishing."""


@dataclass(frozen=True)
class Minimum:
    """A minimum, the number of iterations, and the quasi-Newton matrix at the end."""

    x: FloatArray
    value: float
    iterations: int
    status: str
    curvature: FloatArray
    """The quasi-Newton matrix at the end, to start a similar problem with."""


class _Memory:
    """An objective that stores its last point, and the quasi-Newton matrix built from its gradients."""

    def __init__(self, objective: Objective, curvature: FloatArray | None) -> None:
        self._objective = objective
        self._x: FloatArray | None = None
        self._value, self._gradient = np.nan, np.empty(0)
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._fresh = curvature is None
        self.curvature = curvature
        self.best = np.inf
        self.best_x: FloatArray | None = None

    def evaluate(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return value and gradient; those of the last point are stored."""
        if self._x is None or not np.array_equal(x, self._x):
            self._value, self._gradient = self._objective(x)
            self._x = x.copy()
            if self._value < self.best:
                self.best, self.best_x = self._value, self._x
        return self._value, self._gradient

    def update_curvature(self, x: FloatArray) -> FloatArray:
        """Return the quasi-Newton matrix, updated by the step to a point."""
        gradient = self.evaluate(x)[1]
        if self.curvature is None:
            self.curvature = max(float(np.linalg.norm(gradient)), 1e-8) * np.eye(x.size)
        if self._last is not None:
            self._apply_damped_bfgs(x - self._last[0], gradient - self._last[1])
        self._last = (x.copy(), gradient.copy())
        return self.curvature

    def _apply_damped_bfgs(self, step: FloatArray, change: FloatArray) -> None:
        """Update the matrix by damped BFGS."""
        assert self.curvature is not None
        if not np.any(step) or not np.all(np.isfinite(change)):
            return
        if self._fresh and step @ change > 0:
            self.curvature = float(change @ change / (step @ change)) * np.eye(step.size)
            self._fresh = False
        product = self.curvature @ step
        bend = float(step @ product)
        if bend <= 0:
            return
        slope = float(step @ change)
        if slope < _DAMPING * bend:
            mix = (1 - _DAMPING) * bend / (bend - slope)
            change = mix * change + (1 - mix) * product
            slope = float(step @ change)
        self.curvature = (
            self.curvature - np.outer(product, product) / bend + np.outer(change, change) / slope
        )


class _Call(ca.Callback):
    """A Python function of x under the signature that CasADi's NLP interface asks for."""

    def __init__(
        self,
        name: str,
        inputs: list[ca.Sparsity],
        outputs: list[ca.Sparsity],
        function: Callable[..., list],
    ) -> None:
        ca.Callback.__init__(self)
        self._inputs, self._outputs, self._function = inputs, outputs, function
        self.interruption: KeyboardInterrupt | None = None
        """KeyboardInterrupt raised in the function, which CasADi takes for a failed evaluation."""
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return self._inputs[i]

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return self._outputs[i]

    def eval(self, arguments: list[ca.DM]) -> list:
        """Call the function with the arguments as arrays."""
        try:
            return self._function(*(np.array(argument.nonzeros()) for argument in arguments))
        except KeyboardInterrupt as error:
            self.interruption = error
            raise


def minimise(
    objective: Objective,
    start: FloatArray,
    max_iterations: int,
    curvature: FloatArray | None = None,
    stopping: Mapping[str, float] = LOOSE,
) -> Minimum:
    """Minimise a smooth function with IPOPT.

    Args:
        objective: Function that returns value and gradient at a point.
        start: Point to start from, (n,).
        max_iterations: Largest number of iterations.
        curvature: Quasi-Newton matrix to start with, (n, n).
        stopping: Options of IPOPT that say when to stop, :data:`LOOSE` or :data:`TIGHT`.

    Returns:
        The best point met, whatever IPOPT says of convergence.

    Raises:
        KeyboardInterrupt: The user interrupted an evaluation of the objective.
    """
    n = start.size
    memory = _Memory(objective, curvature)
    x_sparsity, scalar = ca.Sparsity.dense(n), ca.Sparsity.dense(1, 1)
    none = ca.Sparsity(0, 0)
    upper = ca.Sparsity.upper(n)
    rows, columns = (np.array(index) for index in upper.get_triplet())

    def hessian(x: FloatArray, _p: FloatArray, scale: FloatArray, _g: FloatArray) -> list:
        # IPOPT scales steep objectives and says so through the objective's multiplier.
        return [ca.DM(upper, scale[0] * memory.update_curvature(x)[rows, columns])]

    value = _Call("f", [x_sparsity], [scalar], lambda x: [memory.evaluate(x)[0]])
    slope = _Call(
        "grad_f", [x_sparsity, none], [scalar, x_sparsity], lambda x, _: [*memory.evaluate(x)]
    )
    bend = _Call("hess_lag", [x_sparsity, none, scalar, none], [upper], hessian)
    x = ca.MX.sym("x", n)
    options = {
        **_OPTIONS,
        "ipopt": {**_IPOPT, **stopping, "max_iter": max_iterations},
        "grad_f": slope,
        "hess_lag": bend,
    }
    solver = ca.nlpsol("solver", "ipopt", {"x": x, "f": value(x)}, options)
    solver(x0=start)
    for call in (value, slope, bend):
        if call.interruption is not None:
            raise call.interruption
    stats = solver.stats()
    best = memory.best_x if memory.best_x is not None else start
    matrix = memory.curvature if memory.curvature is not None else np.eye(n)
    return Minimum(best, memory.best, int(stats["iter_count"]), stats["return_status"], matrix)

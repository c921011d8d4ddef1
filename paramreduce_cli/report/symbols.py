"""What short headings of tables stand for, said under the tables that have them."""

from collections.abc import Mapping

_EVERYWHERE = {
    "n": "number of parameters of the reduced model",
    "n_φ": "standard parameters that act on the torques",
    "r": "base parameters: the rank of the observation matrix",
    "d": "sums, products and function calls of the inverse dynamics with all parameters",
    "d, n": "the same with n parameters",
    "M, δ": "sums, products and function calls of mass matrix and remainder, gravity included, with all parameters",
    "M, δ, n": "the same with n parameters",
    "ε_τ": "weighted torque error on the estimation set, of the torques' norm",
    "ε_τ E": "weighted torque error on the estimation set, of the torques' norm",
    "ε_τ V": "the same on the validation set",
    "ε_z̈ E": "weighted error of the accelerations on the estimation set",
    "ε_z̈ V": "the same on the validation set",
    "φ' value": "value of the parameter, which stands for those that were dropped too",
}
_OF_TABLES: Mapping[str, Mapping[str, str]] = {
    "pareto-front": {
        "d": "operations of the inverse dynamics",
        "M, δ": "operations of mass matrix and remainder, gravity included",
    },
    "kinematics": {
        "a": "distance of neighbouring joint axes along x, m",
        "alpha": "angle between them about x, rad",
        "d": "distance of neighbouring x axes along the joint axis, m; variable where it slides",
        "theta": "angle between them about the joint axis, rad; variable where it turns",
        "gamma": "angle to the frame that a branch starts from, about the axis before, rad",
        "b": "distance to it along the axis before, m",
    },
    "dynamic-parameters": {
        "m": "mass, kg",
        "mx": "first moments m times the centre of mass, kg m",
        "Ixx": "second moments about the origin of the body's frame, kg m²",
    },
    "drives": {
        "Ia": "inertia of the rotor seen at the joint",
        "fv": "viscous friction",
        "fc": "Coulomb friction",
        "off": "constant torque or force",
        "k": "stiffness of a spring",
    },
    "proofs": {
        "no subset below": "proven: no subset of at most n parameters has a smaller torque error",
        "gap": "how far ε_τ is above that bound",
        "nodes": "branches that were looked at",
        "s": "seconds of one core",
    },
    "operations": {
        "d, lean": "inverse dynamics as exported",
        "d, plain recursion": "by the recursion in body frames, each subexpression once",
        "d, the paper's rule": "as the paper of the method counts",
        "[M, δ], lean": "mass matrix and remainder, gravity included, in the same three ways",
    },
    "terms": {
        "before": "operations, heuristic and number of parameters that it started from",
        "ε_τ random": "torque error on random states inside the limits of the config",
        "ε_z̈ random": "error of the accelerations on these",
        "smallest eigenvalue": "of all mass matrices; positive where motions can be simulated",
    },
    "trajectories": {
        "κ column-normalised": "condition number of the base columns of W, torques over their nominal values, columns of unit length",
        "κ equilibrated": "columns, then rows over their largest entries",
        "κ full": "of all columns, not of the base alone: the singular values that are not zero",
        "κ weighted": "columns as they are",
        "κ at start": "before the optimiser moved it",
        "share of limits": "of the way to the limits that each coordinate uses",
    },
    "identified-errors": {
        "noise": "of the recording above the band of the model, N m",
        "lag-1": "correlation of a residual with the one before; white residuals have 0",
        "eff. samples": "white samples that would tell as much of a constant",
    },
}


def explain_symbols(table: str, header: tuple[str, ...]) -> list[tuple[str, str]]:
    """Return the headings of a table that need an explanation, each once, with their meanings.

    Args:
        table: Name of the table.
        header: Headings of the table.
    """
    meanings = {**_EVERYWHERE, **_OF_TABLES.get(table, {})}
    return [(cell, meanings[cell]) for cell in dict.fromkeys(header) if cell in meanings]

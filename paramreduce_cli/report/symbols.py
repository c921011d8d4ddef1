"""Headings that several tables share, and the meanings of headings, printed under the tables that have them."""

from collections.abc import Mapping

TORQUE_HEADINGS = ("torque error est.", "torque error val.", "torque error test")
ACCELERATION_HEADINGS = ("accel. error est.", "accel. error val.", "accel. error test")
_EVERYWHERE = {
    "n": "number of parameters of the reduced model",
    "acting": "standard parameters that act on the torques",
    "base": "base parameters: the rank of the observation matrix",
    "operations inverse, full": "sums, products and function calls of the inverse dynamics with all parameters",
    "operations inverse": "sums, products and function calls of the inverse dynamics",
    "operations direct, full": "operations of the mass matrix M and the bias δ (gravity included) with all parameters",
    "operations direct": "operations of the mass matrix M and the bias δ, gravity included",
    "torque error": "weighted torque error on the estimation set, relative to the norm of the torques",
    "torque error est.": "weighted torque error on the estimation set, relative to the norm of the torques",
    "torque error val.": "on the validation set",
    "torque error test": "on the test set: median and range of its motions",
    "accel. error est.": "weighted error of the accelerations on the estimation set",
    "φ' value": "lumped value of the parameter, which also stands for a part of the removed parameters",
}
_OF_TABLES: Mapping[str, Mapping[str, str]] = {
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
        "fs": "Stribeck friction",
        "fa": "viscous friction that differs by direction",
        "fq": "quadratic friction",
        "fl": "friction per gravity torque",
    },
    "proofs": {
        "no subset below": "proven: no subset of at most n parameters has a smaller torque error",
        "gap": "distance of the torque error to that bound",
        "nodes": "nodes of the search tree that were evaluated",
        "s": "seconds of one core",
    },
    "operations": {
        "inverse, lean": "inverse dynamics as exported",
        "inverse, textbook": "recursion in body frames, each subexpression once",
        "inverse, paper's rule": "counted like the paper of the method",
        "direct, lean": "mass matrix and bias, gravity included",
    },
    "terms": {
        "before": "operations, heuristic and number of parameters of the start",
        "torque error random": "torque error on random states inside the limits of the config",
        "accel. error random": "error of the accelerations on random states inside the limits",
        "smallest eigenvalue": "of all mass matrices; it must be positive to simulate",
    },
    "trajectories": {
        "κ column-normalised": "condition number of the base columns of W, torques over their nominal values, columns of unit length",
        "κ equilibrated": "columns, then rows over their largest entries",
        "κ full": "of all columns, not of the base alone: the singular values that are not zero",
        "κ weighted": "columns as they are",
        "κ at start": "condition number at the start of the optimisation",
        "share of limits": "largest fraction of the limits that each coordinate uses",
    },
    "identified-errors": {
        "noise": "of the recording above the band of the model, N m",
        "lag-1": "correlation of a residual with the previous one; 0 for white residuals",
        "eff. samples": "equivalent number of white samples",
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

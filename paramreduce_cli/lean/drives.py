"""What drives add to lean models; no choice at a joint changes it."""

from collections.abc import Iterator

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.kinematics import Symbols
from paramreduce_cli.lean.tree import Tree
from paramreduce_cli.multibody.drives import OddFunctions, express_unit_force
from paramreduce_cli.records import Kind

_SCALARS = OddFunctions(Scalar.sign, Scalar.tanh)


def with_drives(
    tree: Tree, symbols: Symbols, torques: list[Scalar], *, moving: bool
) -> list[Scalar]:
    """Torques of the joints with those of drives.

    Args:
        tree: Whose drives.
        symbols: Of the model.
        torques: Of the bodies, (n_q,).
        moving: Whether joints accelerate.
    """
    joints = range(len(tree.joints))
    states = [[symbols.coordinate(i, derivative) for i in joints] for derivative in range(3)]
    result = list(torques)
    for drive, columns in tree.drives:
        force = symbols.number(0.0)
        for kind, position in columns.items():
            if moving or kind is not Kind.ROTOR:
                unit = express_unit_force(kind, drive, states, _SCALARS)
                force = force + symbols.parameter(position) * unit
        for i, weight in _weights(drive.weights.tolist()):
            result[i] = result[i] + weight * force
    return result


def with_rotors(tree: Tree, symbols: Symbols, M: list[list[Scalar]]) -> list[list[Scalar]]:
    """The lower triangle of the mass matrix with the rotors of drives."""
    result = [list(row) for row in M]
    for drive, columns in tree.drives:
        if Kind.ROTOR in columns:
            inertia = symbols.parameter(columns[Kind.ROTOR])
            weights = drive.weights.tolist()
            for i, one in _weights(weights):
                for j, other in _weights(weights[: i + 1]):
                    result[i][j] = result[i][j] + one * other * inertia
    return result


def _weights(weights: list[float]) -> Iterator[tuple[int, float]]:
    return ((i, weight) for i, weight in enumerate(weights) if weight)

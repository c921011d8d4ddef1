"""What drives add to lean models; no choice at a joint changes it."""

from collections.abc import Iterator

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.joint_frames import Tree
from paramreduce_cli.lean.joint_states import Symbols
from paramreduce_cli.multibody.drive_dynamics import OddFunctions, express_unit_force
from paramreduce_cli.records import Kind

_SCALARS = OddFunctions(Scalar.sign, Scalar.take_tanh)


def add_drives(
    tree: Tree, symbols: Symbols, torques: list[Scalar], gravity: list[Scalar], *, moving: bool
) -> list[Scalar]:
    """Return the torques of the joints with the torques of their drives added.

    Args:
        tree: Tree with the drives.
        symbols: Symbols of the model.
        torques: Torques of the bodies, (n_q,).
        gravity: Nominal torques of gravity, (n_q,), empty if no friction depends on them.
        moving: Whether joints accelerate.
    """
    joints = range(len(tree.joints))
    states = [[symbols.read_coordinate(i, derivative) for i in joints] for derivative in range(3)]
    states.append(gravity)
    result = list(torques)
    for drive, columns in tree.drives:
        force = symbols.make_constant(0.0)
        for kind, position in columns.items():
            if (moving or kind is not Kind.ROTOR) and (gravity or kind is not Kind.LOAD):
                unit = express_unit_force(kind, drive, states, _SCALARS)
                force = force + symbols.read_parameter(position) * unit
        for i, weight in _iterate_weights(drive.weights.tolist()):
            result[i] = result[i] + weight * force
    return result


def add_rotors(tree: Tree, symbols: Symbols, M: list[list[Scalar]]) -> list[list[Scalar]]:
    """Return the lower triangle of the mass matrix with the rotors of drives added."""
    result = [list(row) for row in M]
    for drive, columns in tree.drives:
        if Kind.ROTOR in columns:
            inertia = symbols.read_parameter(columns[Kind.ROTOR])
            weights = drive.weights.tolist()
            for i, one in _iterate_weights(weights):
                for j, other in _iterate_weights(weights[: i + 1]):
                    result[i][j] = result[i][j] + one * other * inertia
    return result


def _iterate_weights(weights: list[float]) -> Iterator[tuple[int, float]]:
    return ((i, weight) for i, weight in enumerate(weights) if weight)

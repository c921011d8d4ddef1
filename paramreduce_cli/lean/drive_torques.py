"""What drives add to lean models; no choice at a joint changes it."""

from collections.abc import Iterator, Sequence

from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.joint_frames import Tree, TreeDrive
from paramreduce_cli.lean.joint_states import Symbols
from paramreduce_cli.multibody.drive_dynamics import OddFunctions, express_unit_force
from paramreduce_cli.multibody.drive_motions import DriveMotion, express_weighted_sum, split_motion
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
    result = list(torques)
    for element in tree.drives:
        motion = _build_motion(element, symbols, states)
        force = symbols.make_constant(0.0)
        for kind, position in element.columns.items():
            if (moving or kind is not Kind.ROTOR) and (gravity or kind is not Kind.LOAD):
                unit = express_unit_force(kind, element.drive, motion, gravity, _SCALARS)
                force = force + symbols.read_parameter(position) * unit
        for i, weight in enumerate(motion.weights):
            if weight:
                result[i] = result[i] + weight * force
    return result


def _build_motion(
    element: TreeDrive, symbols: Symbols, states: Sequence[Sequence[Scalar]]
) -> DriveMotion:
    """Return the motion that a drive acts along."""
    if element.motion is None:
        return express_weighted_sum(element.drive, states)
    inputs = [*states[0], *states[1]]
    values = element.motion.rebuild(symbols.graph, lambda position: inputs[position].value)
    return split_motion([Scalar(symbols.graph, value) for value in values])


def add_rotors(tree: Tree, symbols: Symbols, M: list[list[Scalar]]) -> list[list[Scalar]]:
    """Return the lower triangle of the mass matrix with the rotors of drives added."""
    result = [list(row) for row in M]
    for element in tree.drives:
        if Kind.ROTOR in element.columns:
            inertia = symbols.read_parameter(element.columns[Kind.ROTOR])
            weights = element.drive.weights.tolist()
            for i, first in _iterate_weights(weights):
                for j, second in _iterate_weights(weights[: i + 1]):
                    result[i][j] = result[i][j] + first * second * inertia
    return result


def _iterate_weights(weights: list[float]) -> Iterator[tuple[int, float]]:
    return ((i, weight) for i, weight in enumerate(weights) if weight)

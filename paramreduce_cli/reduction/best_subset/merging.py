"""Proofs of several jobs as one."""

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.records import Proofs, ProofStatus


def merged(proofs: Sequence[Proofs]) -> Proofs:
    """What is known of each size by any of several searches on the same data.

    Args:
        proofs: Those of other units or sizes than the last are left out.

    Returns:
        For every size the entry that says most: what is proven, else the smaller error; with the
        largest bound of all, and all nodes.
    """
    first = proofs[-1]
    proofs = [one for one in proofs if _alike(one, first)]
    rows = range(first.n.size)

    def worth(one: Proofs, k: int) -> tuple[bool, float, float]:
        return (
            one.status[k] is ProofStatus.BEST_FOUND,
            float(one.torque_error[k]),
            -float(one.lower_bound[k]),
        )

    best = [min(proofs, key=lambda one: worth(one, k)) for k in rows]
    return Proofs(
        units=first.units,
        n=first.n,
        subsets=tuple(one.subsets[k] for k, one in enumerate(best)),
        torque_error=np.array([one.torque_error[k] for k, one in enumerate(best)]),
        lower_bound=np.max([one.lower_bound for one in proofs], axis=0),
        status=tuple(one.status[k] for k, one in enumerate(best)),
        seconds=np.sum([one.seconds for one in proofs], axis=0),
        nodes=np.sum([one.nodes for one in proofs], axis=0),
        logs=tuple(one.logs[k] for k, one in enumerate(best)),
    )


def _alike(one: Proofs, other: Proofs) -> bool:
    return (
        np.array_equal(one.n, other.n)
        and len(one.units) == len(other.units)
        and all(map(np.array_equal, one.units, other.units))
    )

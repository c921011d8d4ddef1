"""Where bodies are, and how near to each other, by plain products of matrices and brute force."""

import numpy as np

_ALONG = np.linspace(0, 1, 41)


def poses(mechanism, q):
    """Homogeneous transforms of all bodies and of the base, by index, (4, 4) each."""
    found = {-1: np.eye(4)}
    for k, body in enumerate(mechanism.bodies):
        angle = q[k] + body.offset
        c, s = np.cos(angle), np.sin(angle)
        joint = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        if body.joint == "prismatic":
            joint = np.eye(4)
            joint[2, 3] = angle
        found[k] = found[body.parent] @ body.parent_to_joint @ joint @ body.joint_to_body
    return found


def links(mechanism):
    """Lines from each body's joint to those it carries, in its frame, by body; (2, 3) each."""
    found = {k: [] for k in range(-1, len(mechanism.bodies))}
    for k, body in enumerate(mechanism.bodies):
        found[body.parent].append(np.array([np.zeros(3), body.parent_to_joint[:3, 3]]))
        if not any(other.parent == k for other in mechanism.bodies):
            found[k].append(np.zeros((2, 3)))
    return found


def points(mechanism, q):
    """Points on all lines in the base frame, by body, (n, 3)."""
    where = poses(mechanism, q)
    lines = links(mechanism)
    found = {}
    for body, own in lines.items():
        local = [line[0] + _ALONG[:, None] * (line[1] - line[0]) for line in own]
        if local:
            found[body] = np.concatenate(local) @ where[body][:3, :3].T + where[body][:3, 3]
    return found


def clearances(mechanism, q, radius, pairs):
    """Distance between the surfaces of capsules, for pairs of bodies."""
    where = points(mechanism, q)
    return [
        np.linalg.norm(where[a][:, None] - where[b][None], axis=2).min() - 2 * radius
        for a, b in pairs
    ]

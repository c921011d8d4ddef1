"""Commented configs for new robots that are valid as they are."""

_HEAD = """\
# {name}: fill in what is marked TODO. Units are SI; numbers may be written as 1e-3 or pi/2.
# `paramreduce schema` lists every key with its meaning, unit and default.
robot: "{name}"

description:
  gravity: [0, 0, -9.81]        # acceleration of gravity in the base frame, m/s^2
"""

_DH = """\
  dh:
    convention: modified        # modified (Khalil, Craig) or standard
    # TODO one row per joint; a and d in m, alpha and theta in rad. A revolute joint adds its
    # coordinate to theta, a prismatic one (type: prismatic) to d. For a tree give each row a
    # name and the name of its parent.
    joints:
"""

_TREE = """\
  tree:
    # TODO one item per body, parents above their children. A body's frame is its joint's: `at` is
    # where that is in the parent's frame, a point or steps such as [{{xyz: [0, 0, 0.1]}}, {{rz: pi/2}}].
    # joint: revolute (if left out), prismatic, universal, spherical or free; axes: x, y, z (if left
    # out), -x, ... or [x, y, z]; the coordinate is q_BODY unless `coordinates` names it.
    bodies:
      - {{name: torso, axes: z, at: [0, 0, 0.3]}}
      - {{name: left, parent: torso, axes: y, at: [0, 0.2, 0.4]}}
      - {{name: right, parent: torso, axes: y, at: [0, -0.2, 0.4]}}

parameter_sets:
  # TODO the body's mass (kg), centre of mass in its frame (m) and inertia about the centre
  # of mass [Ixx, Ixy, Ixz, Iyy, Iyz, Izz] (kg m^2).
  nominal:
    torso: {{m: 10, com: [0.02, 0, 0.2], inertia_com: [0.2, 0, 0, 0.2, 0, 0.1]}}
    left: {{m: 2, com: [0.15, 0.01, 0], inertia_com: [0.002, 0, 0, 0.02, 0, 0.02]}}
    right: {{m: 2, com: [0.15, -0.01, 0], inertia_com: [0.002, 0, 0, 0.02, 0, 0.02]}}
"""

_LOOP = """\
  tree:
    # TODO the bodies as a tree, each loop cut open at a joint of its own choice; parents above their
    # children. A body's frame is its joint's: `at` is where that is in the parent's frame.
    bodies:
      - {{name: crank, axes: y, coordinates: q_crank}}
      - {{name: coupler, parent: crank, axes: y, at: [0.4, 0, 0]}}
      - {{name: rocker, axes: y, at: [1, 0, 0]}}
    # TODO what closes the loops: two bodies (or base) and where on each. type: fixed, revolute,
    # prismatic, cylindrical, universal, point, planar, distance (with length), coupling (with ratio).
    closures:
      - {{name: pin, type: revolute, bodies: [coupler, rocker],
         at: [[{{xyz: [0.9, 0, 0]}}, {{rx: -pi/2}}], [{{xyz: [0.7, 0, 0]}}, {{rx: -pi/2}}]]}}
    independent: [q_crank]      # TODO the actuated coordinates, which determine all others
    guess: {{q_crank: -1.5, q_coupler: 1, q_rocker: -2}}     # TODO near a closed assembly, rad or m

parameter_sets:
  # TODO the body's mass (kg), centre of mass in its frame (m) and inertia about the centre
  # of mass [Ixx, Ixy, Ixz, Iyy, Iyz, Izz] (kg m^2).
  nominal:
    crank: {{m: 1.2, com: [0.2, 0, 0], inertia_com: [1e-4, 0, 0, 0.016, 0, 0.016]}}
    coupler: {{m: 2, com: [0.45, 0.02, 0], inertia_com: [2e-4, 0, 0, 0.135, 0, 0.135]}}
    rocker: {{m: 1.6, com: [0.35, 0, 0], inertia_com: [2e-4, 0, 0, 0.065, 0, 0.065]}}
"""

_TAIL = """
nominal_torque: standard-deviation   # or one value per joint, N m (N for a prismatic joint)

trajectories:
  count: 10                     # trajectories of the estimation set
  validation_count: 1
  harmonics: 4
  period: 2*pi                  # s
  points: 100                   # samples over a period
  rest_to_rest: true            # begin and end at rest, as a controller needs it
  position_limits: [-pi/2, pi/2]     # TODO for all joints, or a list of one pair per joint, rad (m)
  velocity_limits: 1.5               # TODO for all joints, or one per joint, rad/s (m/s)
  # acceleration_limits: 10          # rad/s^2 (m/s^2)
"""
JUDGEMENT = """\
selected:
  torque_error: 0.01            # the smallest model of all heuristics with an error of at most 1 %; or n: 8

validation:
  accept:                       # exit code 1 where these are not met
    torque_error_test: 0.02
"""
"""What is selected, and when it is accepted."""


def format_dh_template(name: str, joints: int) -> str:
    """Return the text of a config for an arm of revolute joints.

    Args:
        name: Name of the robot.
        joints: Number of joints.
    """
    rows = "".join(
        f"      - {{a: {0.3 if k in (2, 3) else 0}, alpha: {'pi/2' if k % 2 else 0}, d: 0, theta: 0}}\n"
        for k in range(joints)
    )
    bodies = "".join(
        f"    {k + 1}: {{m: {mass:g}, com: [0.1, 0.02, 0.01], inertia_com: [{i:g}, 0, 0, {2 * i:g}, "
        f"0, {2 * i:g}]}}\n"
        for k, (mass, i) in enumerate((10 / (k + 1), 0.1 / (k + 1)) for k in range(joints))
    )
    parameters = (
        "\nparameter_sets:\n"
        "  # TODO the body's mass (kg), centre of mass in its frame (m) and inertia about the centre\n"
        "  # of mass [Ixx, Ixy, Ixz, Iyy, Iyz, Izz] (kg m^2); or first moments mx my mz (kg m) and\n"
        "  # Ixx Ixy Ixz Iyy Iyz Izz about the frame's origin.\n"
        "  nominal:\n"
    )
    return _HEAD.format(name=name) + _DH + rows + parameters + bodies + _TAIL + "\n" + JUDGEMENT


_RECORDED = """
sampling:
  # TODO recorded states of the robot, CSV (also .gz) or HDF5, relative to this file. A CSV has a header: t, then z1 ...
  # zn, dz1 ..., ddz1 ... and tau1 ... for the joints in order; s, rad (m), rad/s, rad/s^2, N m (N).
  estimation_file: {name}-estimation.csv
  validation_file: {name}-validation.csv
  # test_file: {name}-test.csv   # one that no search looks at; `torque_error_test` under accept judges it

drives:
  # Friction and rotors, whose values the recordings tell: each a number, or unknown if yet to be found.
  all: {{inertia: unknown, viscous: unknown, coulomb: unknown, offset: unknown}}
"""


def format_recorded_template(name: str, joints: int) -> str:
    """Return the text of a config for an arm whose motion was recorded.

    Args:
        name: Name of the robot.
        joints: Number of joints.
    """
    before, _, after = format_dh_template(name, joints).partition("\nselected:")
    after = after.replace("torque_error_test", "torque_error_validation")
    return before + _RECORDED.format(name=name) + "\nselected:" + after


def format_tree_template(name: str) -> str:
    """Return the text of a config for a tree of bodies in frames of the user's choice."""
    return (_HEAD + _TREE).format(name=name) + _TAIL + "\n" + JUDGEMENT


def format_loop_template(name: str) -> str:
    """Return the text of a config for a mechanism with a closed loop."""
    return (_HEAD + _LOOP).format(name=name) + _TAIL + "\n" + JUDGEMENT

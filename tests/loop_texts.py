"""Configs of small mechanisms whose equations or results are zero but for rounding."""

from paramreduce_cli.config.loading import load_config

SLIDER = """
robot: slider
description:
  gravity: [0, -9.81, 0]
  tree:
    bodies:
      - {{name: crank, axes: z, coordinates: a, at: [{turns}]}}
      - {{name: rod, parent: crank, axes: z, at: [0.2, 0, 0], coordinates: b}}
      - {{name: slide, joint: prismatic, axes: x, coordinates: s, at: [{turns}]}}
    closures: [{{type: revolute, bodies: [rod, slide], at: [[0.6, 0, 0], [0, 0, 0]]}}]
    independent: [a]
    guess: {{a: 0.7, b: -1.0, s: 0.7}}
parameter_sets:
  p:
    crank: {{m: 1, com: [0.15, 0, 0], inertia_com: [1e-3, 0, 0, 1e-2, 0, 1e-2]}}
    rod: {{m: 1, com: [0.5, 0, 0], inertia_com: [1e-3, 0, 0, 8e-2, 0, 8e-2]}}
    slide: {{m: 1}}
trajectories: {{position_limits: [-1, 1], velocity_limits: 1}}
"""
"""A slider and crank with a hinge that closes it, in a plane turned by some angles."""

PARALLELOGRAM = """
robot: palletizer
constants: {{L: {long}, c: {short}}}
description:
  gravity: [0, -9.81, 0]
  tree:
    bodies:
      - {{name: arm, coordinates: q_arm}}
      - {{name: lever, coordinates: q_lever}}
      - {{name: bar, parent: lever, at: [-c, 0, 0], coordinates: q_bar}}
      - {{name: fore, parent: arm, at: [L, 0, 0], coordinates: q_fore}}
    closures: [{{name: pin, type: {kind}, bodies: [bar, fore], at: [[L, 0, 0], [-c, 0, 0]]}}]
    independent: [q_arm, q_lever]
    guess: {{q_arm: pi/2, q_lever: 0, q_bar: pi/2, q_fore: -pi/2}}
parameter_sets:
  cad:
    arm: {{m: 9, com: [0.3, 0.01, 0], inertia_com: [0.01, 0, 0, 0.3, 0, 0.3]}}
    lever: {{m: 2, com: [-0.05, 0, 0], inertia_com: [0.001, 0, 0, 0.01, 0, 0.01]}}
    bar: {{m: 1.5, com: [0.3, 0, 0], inertia_com: [0.001, 0, 0, 0.05, 0, 0.05]}}
    fore: {{m: 6, com: [0.35, 0.02, 0], inertia_com: [0.01, 0, 0, 0.2, 0, 0.2]}}
trajectories: {{position_limits: [[0.8, 2.2], [-0.6, 0.6]], velocity_limits: 2}}
"""
"""An arm and the linkage that holds its wrist: the bias of its closure cancels."""

TURNTABLE = """
robot: turntable
description:
  gravity: [0, 0, -9.81]
  tree:
    bodies:
      - {{name: a, joint: revolute, axes: {axis}, at: [{{rx: {tilt}}}], coordinates: j}}
parameter_sets:
  p: {{a: {{m: 2, com: [0.1, 0.2, 0.3], inertia_com: [0.03, 0.001, 0.002, 0.04, 0.003, 0.05]}}}}
nominal_torque: 10
trajectories: {{position_limits: [-1, 1], velocity_limits: 1}}
"""
"""A vertical axis that is reached by rotations: gravity cancels."""


def load_text(folder, text, **values):
    """The config of a text with values filled in."""
    path = folder / "config.yaml"
    path.write_text(text.format(**values))
    return load_config(path)

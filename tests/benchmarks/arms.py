"""Two arms that people have, as models of paramreduce and as plain URDF files for other tools."""

import re
import subprocess
import sys
import warnings
from pathlib import Path

from paramreduce_cli.config import load_config
from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.code_generation import make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.records import Run
from paramreduce_cli.reduction.models import make_full_model
from paramreduce_cli.stages.build_model import build_model

WHEEL = next(Path(sys.prefix).rglob("share/example-robot-data/robots"), Path())
ARMS = {
    "UR10": ("ur_description/urdf/ur10_robot.urdf", "base_link", "tool0"),
    "Panda": ("panda_description/urdf/panda.urdf", "panda_link0", "panda_hand"),
}
"""File in the wheel of example-robot-data, and first and last link."""


def write_plain_urdf(label, folder):
    """Return the path of the arm's URDF without meshes, fingers and friction, and the names of its joints."""
    text = (WHEEL / ARMS[label][0]).read_text()
    for kind in ("visual", "collision", "transmission", "gazebo"):
        text = re.sub(rf"<{kind}\b.*?</{kind}>", "", text, flags=re.DOTALL)
    text = re.sub(r"<(safety_controller|mimic)\b[^>]*>", "", text)
    text = re.sub(r"<dynamics\b[^>]*>", "", text)
    for kind in ("link", "joint"):
        text = re.sub(rf'<{kind} name="panda_\w*finger\w*".*?</{kind}>', "", text, flags=re.DOTALL)
    path = folder / f"{label}.urdf"
    path.write_text(text)
    return path, re.findall(r'<joint name="([^"]+)" type="(?:revolute|continuous)"', text)


def build_arm(label, folder, gravity=9.81):
    """Return the model of an arm by its plain URDF, with gravity in m/s^2; its config is written into a folder."""
    config = folder / f"{label}.yaml"
    path, _ = write_plain_urdf(label, folder)
    command = [sys.executable, "-m", "paramreduce_cli", "init", path, "--output", config]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    loaded = load_config(config, [f"description.gravity=[0,0,{-gravity}]"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)
        return build_model(loaded, loaded.model, Run())


def write_code(model, language, what, folder, **options):
    """Write the full model of an arm as code, and return what was exported."""
    chosen = make_full_model(model)
    exported = make_exported_model(model, chosen, title="full", what=what, **options)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in languages[language](exported).items():
        (folder / name).write_bytes(content)
    return exported

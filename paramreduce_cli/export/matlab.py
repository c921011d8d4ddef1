"""MATLAB and Octave: one function a file, and a script that tests them."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.export.exported import ExportedModel, about
from paramreduce_cli.export.language import FUNCTIONS, Language
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import exporter


@exporter("matlab")
def matlab(model: ExportedModel) -> dict[str, bytes]:
    """Function files for MATLAB and Octave; vectors are columns."""
    name = model.name
    files = {
        f"{name}_{function.name}": _function(model, function)
        for function in (*model.functions, *model.closures)
    }
    files[f"{name}_parameters"] = _parameters(model)
    if model.closures:
        files |= _loops(model)
    files[f"{name}_test"] = _test(model)
    return {f"{file}.m": (text + "\n").encode("ascii", "replace") for file, text in files.items()}


def _comment(lines: list[str]) -> list[str]:
    return [f"% {line}".rstrip() for line in lines]


def _function(model: ExportedModel, function: Function) -> str:
    results = ", ".join(r.name for r in function.results)
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [f"function [{results}] = {model.name}_{function.name}({arguments})"]
    documented = [f"{function.text} {function.program.n_operations} operations."]
    documented += [
        f"{array.name}: {array.text}, {' x '.join(map(str, array.shape))}"
        for array in (*function.arguments, *function.results)
    ]
    lines += _comment([*documented, "", *about(model)])
    steps, outputs = _LANGUAGE.body(function)
    lines += [f"{name} = {text};" for name, text in steps]
    for result in function.results:
        rows, columns = (*result.shape, 1)[:2]
        lines.append(f"{result.name} = zeros({rows}, {columns});")
    for (array, k), text in zip(function.places(function.results), outputs, strict=True):
        lines.append(f"{_element(array, k)} = {text};")
    return "\n".join([*lines, "end"])


def _element(array: Argument, k: int) -> str:
    indices = ", ".join(str(int(i) + 1) for i in np.unravel_index(k, array.shape))
    return f"{array.name}({indices})"


_LANGUAGE = Language({name: name for name in FUNCTIONS}, repr, _element)


def _parameters(model: ExportedModel) -> str:
    lines = [f"function phi = {model.name}_parameters()", "% The values of the parameters."]
    lines += _comment(about(model))
    values = "; ".join(repr(p.value) for p in model.parameters)
    return "\n".join([*lines, f"phi = [{values}];", "end"])


def _loops(model: ExportedModel) -> dict[str, str]:
    name = model.name
    d, z = ([k + 1 for k in some] for some in (model.dependent, model.independent.tolist()))
    n = len(d) + len(z)
    positions = f"""function q = {name}_positions(z, guess)
% Close the loops at independent coordinates, by Newton's method.
% z: independent coordinates, {len(z)}
% guess: all coordinates near the solution, {n}
% q: all coordinates, {n}; from a guess far off, perhaps another assembly of the mechanism
q = guess(:);
q({z}) = z;
for step = 1:50
  [Phi, Phi_d] = {name}_closure(q);
  change = Phi_d \\ Phi;
  share = min(1, 0.6 / max(max(abs(change)), realmin));
  for halved = 0:10
    trial = q;
    trial({d}) = q({d}) - share * change;
    if norm({name}_closure(trial)) <= norm(Phi) || max(abs(change)) < 1e-6
      break;
    end
    share = share / 2;
  end
  q = trial;
  if max(abs(change)) < 1e-12
    return;
  end
end
error('the loops cannot be closed from this guess');
end"""
    velocities = f"""function [R, dq] = {name}_velocities(q, dz)
% Solve the velocity problem.
% q: coordinates that close the loops, {n}
% dz: independent velocities, {len(z)}
% R: derivatives of the dependent by the independent coordinates, {len(d)} x {len(z)}
% dq: all velocities, {n}
[Phi_d, Phi_z] = {name}_closure_jacobian(q);
R = -(Phi_d \\ Phi_z);
dq = zeros({n}, 1);
dq({z}) = dz;
dq({d}) = R * dz(:);
end"""
    accelerations = f"""function [b, ddq] = {name}_accelerations(q, dq, R, ddz)
% Solve the acceleration problem.
% q, dq, R: coordinates, velocities and derivatives as from the velocity problem
% ddz: independent accelerations, {len(z)}
% b: accelerations of the dependent coordinates at ddz = 0, {len(d)}
% ddq: all accelerations, {n}
[Phi_d, Phi_z] = {name}_closure_jacobian(q);
b = Phi_d \\ {name}_closure_bias(q, dq);
ddq = zeros({n}, 1);
ddq({z}) = ddz;
ddq({d}) = R * ddz(:) + b;
end"""
    return {
        f"{name}_positions": positions,
        f"{name}_velocities": velocities,
        f"{name}_accelerations": accelerations,
    }


def _test(model: ExportedModel) -> str:
    name, sizes = model.name, model.sizes()
    cases = len(next(iter(model.cases.values())))

    def literal(values: FloatArray) -> str:
        rows = "; ".join(
            " ".join(repr(float(x)) for x in row) for row in np.reshape(values, (cases, -1))
        )
        return f"[{rows}]"

    def one(array: str) -> str:
        row = f"cases.{array}(k, :)"
        shape = sizes[array].shape if array in sizes else (1,)
        if len(shape) == 1:
            return f"{row}'"
        return f"reshape({row}, {shape[1]}, {shape[0]})'"

    def checks(what: str, results: list[str]) -> list[str]:
        return [
            f"  failures = failures + differs('{what}, {r}', {r}, {one(r)}, cases.{r});"
            for r in results
        ]

    lines = [f"function {name}_test()", "% Self-test against an independent formulation."]
    lines += [f"cases.{key} = {literal(values)};" for key, values in model.cases.items()]
    lines += ["failures = 0;", f"for k = 1:{cases}"]
    for function in model.functions:
        arguments = ", ".join(one(a.name) for a in function.arguments)
        results = [r.name for r in function.results]
        lines.append(f"  [{', '.join(results)}] = {name}_{function.name}({arguments});")
        lines += checks(function.name, results)
    if model.closures:
        lines.append(f"  q = {name}_positions({one('z')}, {one('guess')});")
        lines += checks("positions", ["q"])
        lines.append(f"  [R, dq] = {name}_velocities({one('q')}, {one('dz')});")
        lines += checks("velocities", ["R", "dq"])
        given = ", ".join(one(a) for a in ("q", "dq", "R", "ddz"))
        lines.append(f"  [b, ddq] = {name}_accelerations({given});")
        lines += checks("accelerations", ["b", "ddq"])
    lines += [
        "end",
        "if failures > 0",
        "  error('%d results differ', failures);",
        "end",
        "disp('ok');",
        "end",
        "",
        "function bad = differs(what, got, expected, all)",
        "off = max(abs(got(:) - expected(:))) / max([max(abs(all(:))), 1e-300]);",
        "bad = ~(off <= 1e-12) || any(isnan(got(:)));",
        "if bad",
        "  fprintf('FAIL %s: off by %.1e\\n', what, off);",
        "end",
        "end",
    ]
    return "\n".join(lines)

"""CasADi functions as compiled loops over many samples.

The C text that CasADi generates is wrapped in a loop over samples, compiled once by the
system's C compiler and kept in the user's cache under a digest of the text, so that a
second run starts at once. Without a compiler CasADi's own virtual machine does the same
work, slower; :class:`BatchFunction` warns of that once per process.
"""

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
import warnings
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.expressions.cache import (
    find_cache_folder,
    get_temporary_folder,
    identify_machine,
    is_kept,
    keep,
)
from paramreduce_cli.records import FloatArray

_FLAGS = ("-O2", "-fPIC", "-shared", "-fno-math-errno")

_LOOP = """
int paramreduce_batch(long long n, const double* const* in, const long long* in_size,
                      double* const* out, const long long* out_size, double* work) {{
  const double* arg[{n_arg}];
  double* res[{n_res}];
  casadi_int iw[{n_iw}];
  for (long long k = 0; k < n; ++k) {{
    for (int i = 0; i < {n_in}; ++i) arg[i] = in[i] + k * in_size[i];
    for (int i = 0; i < {n_out}; ++i) res[i] = out[i] + k * out_size[i];
    if (kernel(arg, res, iw, work, 0)) {{
      for (int i = 0; i < {n_out}; ++i)
        for (long long j = 0; j < out_size[i]; ++j) out[i][k * out_size[i] + j] = 0.0 / 0.0;
    }}
  }}
  return 0;
}}
"""


class BatchFunction:
    """A function of vectors, evaluated for many samples at once.

    Args:
        inputs: Column vectors of symbols.
        outputs: Dense expressions; a matrix comes out flattened column by column, so hand
            in its transpose to get rows.
        once: Whether it is evaluated so little that compiling it does not pay.
    """

    def __init__(self, inputs: list[ca.MX], outputs: list[ca.MX], *, once: bool = False) -> None:
        dense = ca.cse([ca.densify(ca.vec(output)) for output in outputs])
        self._function = ca.Function("kernel", inputs, dense)
        self._in_sizes = [x.numel() for x in inputs]
        self._out_sizes = [x.numel() for x in outputs]
        self._in_lengths, self._out_lengths = (
            _to_c_numbers(self._in_sizes),
            _to_c_numbers(self._out_sizes),
        )
        self._work_size = max(1, self._function.sz_w())
        self._library = None if once else load(_generate_c(self._function))

    def __call__(self, *arrays: FloatArray) -> list[FloatArray]:
        """Evaluate.

        Args:
            arrays: Inputs, (n_samples, size of the input) each.

        Returns:
            One per output, each (n_samples, size of the output); not a number in a sample whose
            linear systems cannot be solved.
        """
        n = arrays[0].shape[0]
        ins = [
            np.ascontiguousarray(a, dtype=np.float64).reshape(n, size)
            for a, size in zip(arrays, self._in_sizes, strict=True)
        ]
        if self._library is None:
            return self._interpret(n, ins)
        outs = [np.empty((n, size)) for size in self._out_sizes]
        work = np.empty(self._work_size)
        self._library.paramreduce_batch(
            ctypes.c_longlong(n),
            _to_c_pointers(ins),
            self._in_lengths,
            _to_c_pointers(outs),
            self._out_lengths,
            ctypes.c_void_p(get_address(work)),
        )
        return outs

    def _interpret(self, n: int, ins: list[FloatArray]) -> list[FloatArray]:
        """Evaluate the samples in CasADi's virtual machine; NaN where a linear system is singular."""
        if n == 0:
            return [np.empty((0, size)) for size in self._out_sizes]
        try:
            results = self._function.map(n).call([ca.DM(a.T) for a in ins])
        except RuntimeError:  # a linear system somewhere is singular
            if n == 1:
                return [np.full((1, size), np.nan) for size in self._out_sizes]
            parts = [self._interpret(1, [a[k : k + 1] for a in ins]) for k in range(n)]
            return [np.concatenate(column) for column in zip(*parts, strict=True)]
        return [np.ascontiguousarray(result.full().T) for result in results]


def _to_c_numbers(values: list[int]) -> ctypes.Array:
    return (ctypes.c_longlong * len(values))(*values)


def _to_c_pointers(arrays: list[FloatArray]) -> ctypes.Array:
    return (ctypes.c_void_p * len(arrays))(*map(get_address, arrays))


def get_address(array: FloatArray) -> int:
    """Return the address of an array; `array.ctypes` takes longer than many a function of one sample."""
    address: int = array.__array_interface__["data"][0]
    return address


@cache
def find_compiler() -> tuple[str, ...] | None:
    """Return the C compiler's command: ``$CC`` if set, else gcc or cc; None if there is none.

    Raises:
        ConfigError: ``$CC`` cannot be split into words.
    """
    try:
        words = shlex.split(os.environ.get("CC", ""))
    except ValueError as error:
        raise ConfigError(
            f"the variable CC holds no command: {error}. Unset it or fix it."
        ) from error
    names = [words[0]] if words else ["gcc", "cc"]
    path = next((path for name in names if (path := shutil.which(name))), None)
    found = (path, *words[1:]) if path is not None else None
    if found is None:
        warnings.warn(
            "no C compiler found (gcc, cc or $CC): the model runs in CasADi's virtual machine, "
            "with the same results but several times slower",
            ParamreduceWarning,
            stacklevel=2,
        )
    return found


def load(text: str) -> ctypes.CDLL | None:
    """Compile C text to a library, or load the library from the cache.

    Args:
        text: Complete C source.

    Returns:
        The library; None if there is no compiler or compilation fails.
    """
    cc = find_compiler()
    if cc is None:
        return None
    digest = hashlib.sha256(
        "\n".join([text, *cc, *_FLAGS, ca.CasadiMeta.version(), identify_machine()]).encode()
    ).hexdigest()
    name, command = f"{digest[:32]}.so", [*cc, *_FLAGS]
    try:
        try:
            return _load_library(command, text, find_cache_folder() / name)
        except OSError as error:
            warnings.warn(
                f"{find_cache_folder()} cannot hold compiled models ({error.strerror or error}), so they are compiled in every "
                "run; name another folder in PARAMREDUCE_CACHE",
                ParamreduceWarning,
                stacklevel=2,
            )
            return _load_library(command, text, get_temporary_folder() / name)
    except (OSError, subprocess.CalledProcessError) as error:
        detail = getattr(error, "stderr", None) or str(error)
        warnings.warn(
            f"the C compiler {cc[0]} failed ({str(detail).strip().splitlines()[-1]}): the model runs "
            "in CasADi's virtual machine, with the same results but several times slower",
            ParamreduceWarning,
            stacklevel=2,
        )
        return None


def _load_library(command: list[str], text: str, path: Path) -> ctypes.CDLL:
    """Load a library from the cache; compile it first if the cache lacks it.

    Raises:
        OSError: The folder does not allow writing files or running code.
        subprocess.CalledProcessError: The compiler fails.
    """
    if not is_kept(path):
        _compile(command, text, path)
    return ctypes.CDLL(str(path))


def _generate_c(function: ca.Function) -> str:
    """Return the C text of a function with a loop over samples."""
    generator = ca.CodeGenerator("kernel.c", {"with_header": False})
    generator.add(function)
    loop = _LOOP.format(
        n_arg=max(1, function.sz_arg()),
        n_res=max(1, function.sz_res()),
        n_iw=max(1, function.sz_iw()),
        n_in=function.n_in(),
        n_out=function.n_out(),
    )
    return generator.dump() + loop


def _compile(command: list[str], text: str, library: Path) -> None:
    """Compile beside the target, so that parallel runs never load half a file."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        source = Path(folder, "kernel.c")
        source.write_text(text)
        built = Path(folder, "kernel.so")
        subprocess.run(
            [*command, str(source), "-o", str(built), "-lm"],
            check=True,
            capture_output=True,
            text=True,
        )
        keep(built, library)

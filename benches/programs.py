"""Programs that the benchmarks compare painleve with: their Python environments, and their results."""

import json
import os
import subprocess
import venv
from pathlib import Path

TARGET = Path(__file__).resolve().parent.parent / "target"


def python_with(environment, packages):
    """The Python of an environment below target/ with packages, given with the module of each.

    Raises RuntimeError if one cannot be installed.
    """
    python = TARGET / environment / "bin" / "python"
    if not python.exists():
        venv.create(TARGET / environment, with_pip=True)
    for package, module in packages.items():
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
            install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", package]
            done = subprocess.run(install, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"pip cannot install {package}: {last_line(done.stderr)}")
    return python


def one_thread_each():
    """Keeps the libraries of the programs to one thread, like painleve."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


def result_of(name, line):
    """Runs a command line, and returns the JSON of its last line. Raises RuntimeError if it fails."""
    done = subprocess.run(line, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{name} fails: {last_line(done.stderr)}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def last_line(text):
    return (text.strip().splitlines() or ["no reason given"])[-1]

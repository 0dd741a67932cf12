#!/usr/bin/env python3
"""painleve's controller on other people's plants: closed loops on MuJoCo and Drake, with our own plants beside.

    cargo build --release -p painleve-c-abi && python3 benches/others/run.py

The controller runs through the C interface (sil-host/c-abi), the plant in Python; both see only the frames of a real bench: 1 kHz,
encoders of 14 bits, force and torque of 12 bits, 0.02 N of force noise, one sample of delay. MuJoCo and Drake go into a virtual
environment below target/. A plant that cannot be installed is reported as missing. Every plant gets the same 60 random runs:
the paper's arm, known exactly, mu 0.3 ... 0.9, belt 0.1 ... 1 m/s, half of the targets up to 20 mm beyond the edge p = 0.
Prints a Markdown table.
"""

import argparse
import json
import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
TARGET = HERE.parent.parent / "target"
ENVIRONMENT = TARGET / "others"
LIBRARY = TARGET / "release" / "libpainleve_c.so"

# Module of each plant, the package that it needs, and how it treats a sliding contact.
PLANTS = {
    "painleve, rigid": ("own", None, "mode by the signs of p and b, Coulomb friction, impacts in closed form"),
    "painleve, compliant": ("own", None, "spring and damper of 1e5 N/m and 76 N s/m, bristle friction"),
    "MuJoCo, Coulomb friction added": (
        "mujoco_arm",
        "mujoco",
        "MuJoCo's normal contact, 1e5 N/m and 76 N s/m for 40 g; mu f_n of the step before (0.1 ms) as an external force",
    ),
    "MuJoCo, its own friction": (
        "mujoco_arm",
        "mujoco",
        "a convex problem in each step (0.1 ms), default softness: it separates surfaces that slide, p plays no part",
    ),
    "Drake": (
        "drake_arm",
        "drake",
        "point contact of 1e5 N/m with Hunt-Crossley damping, regularised friction, solved implicitly in steps of 0.1 ms",
    ),
}


def environment_with(package):
    """The environment's Python with a package, or why there is none."""
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        venv.create(ENVIRONMENT, with_pip=True)
    wanted = ["numpy"] + ([package] if package else [])
    for name in wanted:
        module = "pydrake" if name == "drake" else name
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
            install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", name]
            done = subprocess.run(install, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"pip cannot install {name}: {last_line(done.stderr)}")
    return python


def last_line(text):
    return (text.strip().splitlines() or ["no reason given"])[-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--plant", choices=list(PLANTS), action="append", help="all by default")
    options = parser.parse_args()
    if not LIBRARY.exists():
        sys.exit(f"there is no {LIBRARY}: run cargo build --release -p painleve-c-abi")
    # One thread each.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    print("| plant | succeed | plant alone, simulated s per CPU s | failures | sliding contact |")
    print("|---|---|---|---|---|")
    for name in options.plant or PLANTS:
        module, package, contact = PLANTS[name]
        try:
            python = environment_with(package)
            line = [python, HERE / "loop.py", LIBRARY, module, name, str(options.runs), str(options.seed)]
            done = subprocess.run(line, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"{module} fails: {last_line(done.stderr)}")
        except (RuntimeError, OSError) as error:
            print(f"| {name} | missing: {error} | | | {contact} |", flush=True)
            continue
        result = json.loads(done.stdout.strip().splitlines()[-1])
        speed = result["simulated_s"] / result["plant_cpu_s"]
        failures = ", ".join(f"{count} {ending}" for ending, count in sorted(result["failures"].items())) or "none"
        version = f" ({result['version']})" if result["version"] else ""
        print(
            f"| {name}{version} | {result['successes']} of {options.runs} | {speed:,.0f} | {failures} | {contact} |",
            flush=True,
        )


main()

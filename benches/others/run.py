#!/usr/bin/env python3
"""painleve's controller on other people's plants: closed loops on MuJoCo and Drake, with our own plants beside.

    cargo build --release -p painleve-c-abi && python3 benches/others/run.py

The controller runs through the C interface (sil-host/c-abi), the plant in Python; both see only the frames of a real bench: 1 kHz,
encoders of 14 bits, force and torque of 12 bits, 0.02 N of force noise, one sample of delay. MuJoCo and Drake go into a virtual
environment below target/. A plant that cannot be installed is reported as missing. Every plant gets the same 60 random runs:
the paper's arm, known exactly, mu 0.3 ... 0.9, belt 0.1 ... 1 m/s, half of the targets up to 20 mm beyond the edge p = 0.
Prints a Markdown table, or, with --json, an object for each plant; then a missing plant is an error.
"""

import argparse
import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from programs import TARGET, one_thread_each, python_with, result_of

LIBRARY = TARGET / "release" / "libpainleve_c.so"

# Each plant's label, its module, the packages that it needs with their modules, and how it treats a sliding contact.
PLANTS = {
    "rigid": ("painleve, rigid", "own", {}, "mode by the signs of p and b, Coulomb friction, impacts in closed form"),
    "compliant": ("painleve, compliant", "own", {}, "spring and damper of 1e5 N/m and 76 N s/m, bristle friction"),
    "mujoco": (
        "MuJoCo, Coulomb friction added",
        "mujoco_arm",
        {"mujoco": "mujoco"},
        "MuJoCo's normal contact, in steps of 0.1 ms; μ f_n of the same step as an external force",
    ),
    "mujoco-own": (
        "MuJoCo, its own friction",
        "mujoco_arm",
        {"mujoco": "mujoco"},
        "a convex problem in each step: it separates surfaces that slide, p plays no part",
    ),
    "drake": (
        "Drake",
        "drake_arm",
        {"drake": "pydrake"},
        "point contact with Hunt-Crossley damping, regularised friction, continuous, with error control",
    ),
}


def measure(plant, options):
    """Runs the closed loops on a plant. Raises RuntimeError if it cannot be installed."""
    label, module, packages, contact = PLANTS[plant]
    python = python_with("others", {"numpy": "numpy", **packages})
    line = [python, HERE / "loop.py", options.library, module, label, str(options.runs), str(options.seed)]
    return {**result_of(module, line), "runs": options.runs, "contact": contact}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--plant", choices=list(PLANTS), action="append", help="all by default")
    parser.add_argument("--library", type=Path, default=LIBRARY, help="the C library")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if not options.library.exists():
        sys.exit(f"there is no {options.library}: run cargo build --release -p painleve-c-abi")
    options.library = options.library.resolve()
    one_thread_each()
    plants = options.plant or list(PLANTS)
    if options.json:
        print(json.dumps({plant: measure(plant, options) for plant in plants}))
        return
    print("| plant | succeed | plant alone, simulated s per CPU s | failures | sliding contact |")
    print("|---|---|---|---|---|")
    for plant in plants:
        name, _, _, contact = PLANTS[plant]
        try:
            result = measure(plant, options)
        except (RuntimeError, OSError) as error:
            print(f"| {name} | missing: {error} | | | {contact} |", flush=True)
            continue
        speed = result["simulated_s"] / result["plant_cpu_s"]
        failures = ", ".join(f"{count} {ending}" for ending, count in sorted(result["failures"].items())) or "none"
        version = f" ({result['version']})" if result["version"] else ""
        print(
            f"| {name}{version} | {result['successes']} of {options.runs} | {speed:,.0f} | {failures} | {contact} |",
            flush=True,
        )


main()

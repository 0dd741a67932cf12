#!/usr/bin/env python3
"""The open-loop bounce (x0,a, mu = 0.6, v_belt = -0.4 m/s) by painleve and by other simulators, in one run.

    cargo build --release && python3 benches/peers/run.py

Prints a Markdown table of simulated seconds per CPU second, or, with --json, an object for each program. SciPy and
MuJoCo go into a virtual environment of their own below target/; Siconos comes from Debian (apt-get install
python3-siconos). The table reports a program that cannot be installed or does not run as missing; --json fails.
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from programs import TARGET, one_thread_each, python_with, result_of

PAINLEVE = TARGET / "release" / "painleve"

# Simulated seconds: a few CPU seconds each.
PAINLEVE_S, SCIPY_S, MUJOCO_S, SICONOS_S = 20_000, 60, 100, 30

PARADOX = {
    "painleve": "decided by the signs of p and b, in closed form",
    "SciPy": "the same rules with `solve_ivp` and its events",
    "MuJoCo": "not reproduced: soft, convex contact throws the tip off, depending on softness and step",
    "Siconos": "not reproduced: one impulse per step under Newton's impact law; the bounce dies out",
}


def peer(python, script, simulated_s):
    return result_of(script, [python, HERE / script, str(simulated_s)])


def painleve():
    arguments = "study bifurcation --mu 0.6 --v-belt=-0.4 --initial a --threads 1 --json".split()
    arguments += ["--transient-s", "0.001", "--record-s", str(PAINLEVE_S), "--relative-tolerance", "1e-9"]

    def cpu_s():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    before_s = cpu_s()
    done = subprocess.run([PAINLEVE, *arguments], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    row = json.loads(done.stdout)["rows"][0]
    return {
        "simulated_s": PAINLEVE_S,
        "cpu_s": cpu_s() - before_s,
        "touches_per_s": row["impacts_per_s"],
        "apex_m": row["apex_m"],
        "max_theta1_dot_rad_s": row["max_theta1_dot_rad_s"],
        "version": "",
        "settings": "DOP853 with located events, relative tolerance 1e-09; start of the program included",
    }


def scipy():
    return peer(python_with("peers", {"numpy": "numpy", "scipy": "scipy"}), "bounce_scipy.py", SCIPY_S)


def mujoco():
    return peer(python_with("peers", {"mujoco": "mujoco"}), "bounce_mujoco.py", MUJOCO_S)


def siconos():
    python = "/usr/bin/python3"
    if subprocess.run([python, "-c", "import siconos.kernel"], capture_output=True).returncode:
        raise RuntimeError("not installed; on Debian: apt-get install python3-siconos")
    asked = ["dpkg-query", "--show", "--showformat=${Version}", "python3-siconos"]
    version = subprocess.run(asked, capture_output=True, text=True).stdout.split("+")[0]
    return {**peer(python, "bounce_siconos.py", SICONOS_S), "version": version}


def measured(name, measure):
    """The figures of a program, for docs/measured/."""
    result = measure()
    speed = result["simulated_s"] / result["cpu_s"]
    return {
        "version": result["version"],
        # A whole number where a fraction says nothing.
        "simulated_s_per_cpu_s": round(speed) if speed > 100 else speed,
        "touches_per_s": result["touches_per_s"],
        "apex_m": result["apex_m"],
        "paradox": PARADOX[name],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if not PAINLEVE.exists():
        sys.exit(f"there is no {PAINLEVE}: run cargo build --release")
    one_thread_each()
    programs = {"painleve": painleve, "SciPy": scipy, "MuJoCo": mujoco, "Siconos": siconos}
    if options.json:
        print(json.dumps({name: measured(name, measure) for name, measure in programs.items()}))
        return
    print("| program | simulated s per CPU s | painleve is faster by | impacts per s | apex | largest θ̇₁ | the paradox |")
    print("|---|---|---|---|---|---|---|")
    ours, notes = None, []
    for name, measure in programs.items():
        try:
            result = measure()
        except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
            if name == "painleve":
                raise
            print(f"| {name} | missing: {error} | | | | | {PARADOX[name]} |")
            continue
        speed = result["simulated_s"] / result["cpu_s"]
        ours = ours or speed
        last = f"; last touch at {result['last_touch_s']:.1f} s" if "last_touch_s" in result else ""
        notes.append(f"{name} {result['version']}: {result['simulated_s']:g} s simulated{last}; {result['settings']}.")
        print(
            f"| {name} | {speed:,.{0 if speed > 100 else 1}f} | {ours / speed:,.0f} × | {result['touches_per_s']:.1f} "
            f"| {result['apex_m'] * 1e3:.1f} mm | {result['max_theta1_dot_rad_s']:.2f} rad/s | {PARADOX[name]} |",
            flush=True,
        )
    print()
    print("\n".join(notes))


main()

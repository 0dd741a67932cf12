"""Checks the FMU with FMPy: its description is valid, it refuses bad calls, it repeats itself, and without control the
arm bounces at exactly the belt speeds at which the plant itself does (37 speeds, 300 s each).

    python3 -m venv venv && venv/bin/pip install 'fmpy==0.3.*'
    venv/bin/python fmu/check.py target/fmu/painleve.fmu
"""

import csv
import pathlib
import re
import sys
import tempfile
from xml.etree import ElementTree

import calls
import fmpy
from fmpy.validation import validate_fmu

PAGE = pathlib.Path(__file__).parent.parent / "docs/interface.md"
SECTION = pathlib.Path(__file__).parent.parent / "sil-host/plant/tests/data/open_loop_section_mu06.csv"


def simulate(model, **arguments):
    return fmpy.simulate_fmu(model["folder"], model_description=model["description"], **arguments)


def bounces(model, speed_m_s):
    """Whether the arm still moves in the last 50 s of 300 s."""
    run = simulate(
        model,
        stop_time=300.0,
        step_size=0.05,
        output_interval=0.05,
        start_values={"belt.speed_m_s": speed_m_s},
        output=["theta1_dot_rad_s"],
    )
    return run["theta1_dot_rad_s"][run["time"] > 250.0].max() > 0.1


def main(fmu):
    problems = validate_fmu(fmu)
    assert not problems, problems
    with tempfile.TemporaryDirectory() as folder:
        check(fmpy.extract(fmu, unzipdir=folder))

    # The snippet of the documentation, which names the file that `cargo xtask fmu` writes.
    [snippet] = re.findall(r"```python\n(import fmpy.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    exec(snippet, {})


def check_files(folder):
    """Every file that a description names is in the archive."""
    described = folder / "sources/buildDescription.xml"
    names = [file.get("name") for file in ElementTree.parse(described).iter("SourceFile")] if described.exists() else []
    missing = [name for name in names if not (folder / "sources" / name).exists()]
    assert not missing, f"sources/buildDescription.xml names {missing}, which the archive lacks"
    identifier = fmpy.read_model_description(folder).coSimulation.modelIdentifier
    assert list((folder / "binaries").glob(f"*/{identifier}.so")), f"no library {identifier}"


def check(folder):
    check_files(pathlib.Path(folder))
    model = {"folder": folder, "description": fmpy.read_model_description(folder)}
    calls.check(pathlib.Path(folder), model["description"])

    first, second = (simulate(model, stop_time=1.0, output_interval=1e-3) for _ in range(2))
    assert (first == second).all(), "two runs differ"
    assert len(first) == 1001 and first["gap_m"].max() > 1e-3, "the tip is not thrown off the belt"

    heavier = simulate(model, stop_time=1.0, output_interval=1e-3, start_values={"settings": "arm.tip_mass_kg=0.001"})
    assert (heavier["theta1_rad"] != first["theta1_rad"]).any(), "a mass at the tip changes nothing"
    try:
        simulate(model, stop_time=1.0, start_values={"belt.friction": -1.0})
    except Exception as refusal:
        print("negative friction:", refusal)
    else:
        raise AssertionError("negative friction is accepted")

    with SECTION.open() as section:
        rows = [(float(row["v_belt"]), float(row["max_theta1_dot_from_x0a"]) > 0.1) for row in csv.DictReader(section)]
    bouncing = [speed for speed, _ in rows if bounces(model, speed)]
    assert bouncing == [speed for speed, expected in rows if expected], bouncing
    print(f"{len(bouncing)} of {len(rows)} belt speeds bounce, from {bouncing[0]} to {bouncing[-1]} m/s, as in the plant")


main(sys.argv[1])

"""Sweeps, comparisons, figures, margins, and the types that the package declares."""

import ast
import math
from pathlib import Path

import matplotlib
import painleve
import pytest

matplotlib.use("svg")
SHORT = {"run.duration_s": 0.5}


def test_a_sweep_has_a_line_for_each_combination():
    keys = {"belt.friction": [0.4, 0.6], "controller.law.hybrid.normal_force_n": [5, 10, 20]}
    lines = painleve.sweep("hybrid-elbow-down", keys, SHORT)
    assert len(lines) == 6
    assert list(lines["belt.friction"]) == [0.4] * 3 + [0.6] * 3
    assert list(lines["controller.law.hybrid.normal_force_n"]) == [5, 10, 20] * 2
    assert (lines["lift_offs"] == 0).all() and (lines["fault"] == 0).all()
    largest = painleve.sweep("edge", {"belt.friction": [0.5]}, SHORT, lambda run: {"largest": max(run["plant.tip_t_m"])})
    assert list(largest.columns) == ["belt.friction", "largest"]
    with pytest.raises(ValueError, match="belt.friction"):
        painleve.sweep("edge", {"belt.friction": [-1]})


def test_a_run_that_ends_with_a_fault_has_no_error_at_the_end():
    lines = painleve.sweep("pid-elbow-up", {"run.seed": [1]})
    assert lines["fault"][0] == 7 and lines["rms_error_m"][0] > 0.05
    assert math.isnan(lines["final_error_m"][0])


def test_runs_are_compared_from_an_event_on():
    first = painleve.run("edge", SHORT)
    same = painleve.compare(first, first)
    assert len(same) >= 5 and (same["largest"] == 0).all()
    # The same run enabled 0.1 s late, at rest until then. An arm that is really enabled late starts elsewhere: the belt drags it.
    wait = 100
    late = {name: [column[0]] * wait + column for name, column in first.items()}
    late["time_s"] = [1e-3 * tick for tick in range(len(late["time_s"]))]
    late["sensor.inputs"][:wait] = [0] * wait
    aligned = painleve.compare(first, late)
    assert list(aligned["quantity"]) == list(same["quantity"]) and (aligned["largest"].abs() < 1e-9).all()
    unaligned = painleve.compare(first, late, align="start").set_index("quantity")
    assert unaligned.loc["tip_mm", "rms"] > 0.1
    # A run tells when it was enabled.
    enabled_s = [painleve.compare(run, run)["at_s"].min() for run in (first, painleve.run("edge", {**SHORT, "run.enable_at_s": 0.1}))]
    assert enabled_s == pytest.approx([0.0, -0.1])
    with pytest.raises(ValueError, match="align"):
        painleve.compare(first, late, align="end")


def test_a_comparison_has_the_quantities_of_the_command():
    first, second = painleve.run("edge", SHORT), painleve.run("edge", {**SHORT, "belt.friction": 0.5})
    differences = painleve.compare(first, second).set_index("quantity")
    assert list(differences.index) == ["tip_mm", "error_mm", "gap_mm", "normal_force_n", "u1_nm", "u2_nm", "friction"]
    errors_mm = [
        [1e3 * (tip - reference) for tip, reference in zip(run["plant.tip_t_m"], run["plant.reference_tip_t_m"])]
        for run in (first, second)
    ]
    mean = sum(other - one for one, other in zip(*errors_mm)) / len(errors_mm[0])
    assert math.isclose(differences.loc["error_mm", "mean"], mean, rel_tol=1e-9)


def test_a_plot_counts_time_from_the_event_that_a_comparison_takes():
    late = painleve.run("edge", {**SHORT, "run.enable_at_s": 0.1})
    begins = {align: painleve.plot(late, align=align).axes[0].lines[0].get_xdata()[0] for align in ("enable", "start")}
    begins["default"] = painleve.plot(late).axes[0].lines[0].get_xdata()[0]
    assert begins == pytest.approx({"enable": -0.1, "start": 0.0, "default": -0.1})
    never = painleve.run("edge", {**SHORT, "run.enable_at_s": 1.0})
    with pytest.raises(ValueError, match="align = 'enable': this does not happen in a run; choose another event"):
        painleve.plot(never)


def test_a_plot_has_a_panel_for_each_quantity():
    runs = [painleve.run("edge", {**SHORT, "belt.friction": friction}) for friction in (0.4, 0.6)]
    figure = painleve.plot(*runs, labels=["0.4", "0.6"])
    assert len(figure.axes) == 4
    assert all(len(axis.lines) >= 2 for axis in figure.axes)


def test_the_loop_is_linearised():
    (row,) = painleve.linearise("hybrid", 0.05, frequencies=3)
    loops = {loop["name"]: loop for loop in row["loops"]}
    assert loops["position"]["margins"]["phase_deg"] > 20
    point = loops["position"]["points"][0]
    assert math.isclose(point["gain_db"], point["measured_gain_db"], abs_tol=0.5)


def declared(name):
    stub = Path(painleve.__file__).parent / "_painleve.pyi"
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    (found,) = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name]
    return {line.target.id for line in found.body if isinstance(line, ast.AnnAssign)}


def test_declared_fields_are_those_that_are_returned():
    run = painleve.run("edge", SHORT)
    fields = {name: {column.removeprefix(f"{name}.") for column in run if column.startswith(f"{name}.")} for name in ("plant", "estimates")}
    assert declared("State") == fields["plant"] | {"time_s"}
    assert declared("Telemetry") == fields["estimates"]
    assert set(painleve.Plant().state()) <= declared("State")
    assert set(painleve.Controller().telemetry()) <= declared("Telemetry")
    assert (Path(painleve.__file__).parent / "py.typed").exists()

"""Many runs, and what they show: sweeps, differences, figures, margins.

`sweep`, `compare` and `plot` need the package's extra `plot`: pandas, Matplotlib and NumPy.
"""

import itertools
import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Iterable, Mapping, Sequence

from ._painleve import run, study

Run = Mapping[str, Sequence[Any]]

#: What `compare` compares: the name, the column of the simulated arm, what is subtracted, the factor to the unit of the name.
QUANTITIES = (
    ("tip_mm", "plant.tip_t_m", None, 1e3),
    ("error_mm", "plant.tip_t_m", "plant.reference_tip_t_m", 1e3),
    ("gap_mm", "plant.gap_m", None, 1e3),
    ("normal_force_n", "plant.normal_force_n", None, 1.0),
    ("u1_nm", "plant.u1_nm", None, 1.0),
    ("u2_nm", "plant.u2_nm", None, 1.0),
    ("friction", "estimates.friction", None, 1.0),
)
#: Columns of the panels of `plot`.
PANELS = (
    ("tip (m)", ("plant.tip_t_m", "plant.reference_tip_t_m")),
    ("normal force (N)", ("plant.normal_force_n",)),
    ("torques (N·m)", ("plant.u1_nm", "plant.u2_nm")),
    ("friction", ("estimates.friction",)),
)


def outcome(columns: Run) -> dict[str, float]:
    """Returns what became of a run: lift-offs that last until a tick, fault (0 for none), tip and tracking error at the end
    (NaN after a fault), RMS error, largest torque."""
    pairs = zip(columns["plant.tip_t_m"], columns["plant.reference_tip_t_m"])
    # NaN without a reference, as after a fault: an earlier error is not that at the end.
    all_errors = [tip - reference for tip, reference in pairs]
    errors = [error for error in all_errors if math.isfinite(error)]
    modes = columns["plant.mode"]
    torques = itertools.chain(columns["plant.u1_nm"], columns["plant.u2_nm"])
    return {
        "lift_offs": sum(now == "flight" != before for before, now in itertools.pairwise(modes)),
        "fault": columns["actuator.fault_number"][-1],
        "final_tip_m": columns["plant.tip_t_m"][-1],
        "final_error_m": all_errors[-1],
        "rms_error_m": math.sqrt(sum(error * error for error in errors) / len(errors)) if errors else math.nan,
        "peak_torque_nm": max(map(abs, torques)),
    }


def sweep(
    scenario: str | os.PathLike[str],
    keys: Mapping[str, Iterable[Any]],
    overrides: Mapping[str, Any] | None = None,
    measure: Callable[[Run], Mapping[str, Any]] = outcome,
):
    """Runs a scenario with all combinations of values of its keys, and returns a DataFrame with a line for each: the
    values, and what `measure` returns for the run. The last key varies fastest; runs share the cores. Ctrl-C ends it when
    the runs that have begun are done."""
    import pandas

    for name, values in keys.items():
        if isinstance(values, str) or not isinstance(values, Iterable):
            raise TypeError(f"{name} = {values!r}: give a list of values")
    names = list(keys)
    settings = [dict(zip(names, values)) for values in itertools.product(*(list(keys[name]) for name in names))]

    def line(values):
        return {**values, **measure(run(scenario, {**(overrides or {}), **values}))}

    # A run releases the interpreter.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return pandas.DataFrame(list(pool.map(line, settings)))


def _zero(columns: Run, align: str) -> float:
    """Returns the time of an event of a run, s."""
    flags = {"enable": ("sensor.inputs", 1), "contact": ("actuator.flags", 1)}
    if align == "start":
        return columns["time_s"][0]
    if align not in flags:
        raise ValueError(f"align = '{align}': enable, contact or start")
    column, bit = flags[align]
    for time_s, value in zip(columns["time_s"], columns[column]):
        if int(value) & bit:
            return time_s
    raise ValueError(f"align = '{align}': this does not happen in a run; choose another event")


def compare(first: Run, *others: Run, align: str = "enable"):
    """Returns how much runs differ from the first, as a DataFrame: mean, RMS and largest difference of each quantity, and
    when it is largest. Time is counted from an event: `enable`, `contact` (the first found by the controller) or `start`."""
    import numpy
    import pandas

    def values(columns, column, minus):
        values = numpy.asarray(columns[column])
        return values if minus is None else values - numpy.asarray(columns[minus])

    lines = []
    zero = _zero(first, align)
    times = numpy.asarray(first["time_s"]) - zero
    for number, other in enumerate(others, 1):
        other_times = numpy.asarray(other["time_s"]) - _zero(other, align)
        for name, column, minus, scale in QUANTITIES:
            other_values = numpy.interp(times, other_times, values(other, column, minus), numpy.nan, numpy.nan)
            difference = scale * (other_values - values(first, column, minus))
            known = numpy.isfinite(difference)
            if known.any():
                difference, at = difference[known], times[known]
                largest = int(numpy.abs(difference).argmax())
                lines.append({
                    "run": number,
                    "quantity": name,
                    "mean": difference.mean(),
                    "rms": math.sqrt((difference**2).mean()),
                    "largest": difference[largest],
                    "at_s": at[largest],
                })  # fmt: skip
    return pandas.DataFrame(lines)


def plot(*runs: Run, labels: Sequence[str] = (), align: str = "enable"):
    """Draws runs over time, one above the other in each panel, and returns the Matplotlib figure. Time is counted from an
    event, as by `compare`."""
    import matplotlib.pyplot as pyplot

    if labels and len(labels) != len(runs):
        raise ValueError(f"labels: {len(labels)} for {len(runs)} runs")
    figure, axes = pyplot.subplots(len(PANELS), sharex=True, figsize=(8, 9), layout="constrained")
    for number, columns in enumerate(runs):
        zero = _zero(columns, align)
        times = [time_s - zero for time_s in columns["time_s"]]
        label = labels[number] if labels else None
        for axis, (title, names) in zip(axes, PANELS):
            axis.set_ylabel(title)
            for which, name in enumerate(names):
                style = "-" if which == 0 else "--"
                axis.plot(times, columns[name], style, color=f"C{number}", label=label if which == 0 else None)
    if labels:
        axes[0].legend()
    axes[-1].set_xlabel(f"time after {align} (s)")
    return figure


def linearise(controller: str = "hybrid", tip: float | Sequence[float] = 0.05, **options: Any) -> list[dict[str, Any]]:
    """Returns the sampled loop in the frequency domain at places of the tip (m): the rows of `painleve study loop`, with
    margins, frequency response and steps."""
    return study("loop", controller=controller, tip=tip, **options)["rows"]

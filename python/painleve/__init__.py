"""A robot arm that presses its tip on a moving belt: plant, real-time controller, runs.

A scenario is the name of a built-in one (`painleve scenarios`) or a TOML text; `overrides` are keys with values: numbers,
texts, True and False, lists, tuples, arrays, and dictionaries for tables::

    import pandas, painleve
    run = pandas.DataFrame(painleve.run("edge", {"belt.friction": 0.5})).set_index("time_s")
    run[["plant.tip_t_m", "plant.reference_tip_t_m"]].plot()
"""

from ._painleve import Controller, Plant, Simulation, run, study

__all__ = ["Controller", "Plant", "Simulation", "run", "study"]

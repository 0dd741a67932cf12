"""A robot arm that presses its tip on a moving belt: plant, real-time controller, runs.

A scenario is the name of a built-in one (`painleve scenarios`) or a TOML text; `overrides` are keys with values in TOML::

    import pandas, painleve
    run = pandas.DataFrame(painleve.run("edge", {"belt.friction": 0.5})).set_index("time_s")
    run[["plant.tip_t_m", "plant.reference_tip_t_m"]].plot()
"""

import json

from . import _painleve
from ._painleve import Controller, Plant, Simulation, run

__all__ = ["Controller", "Plant", "Simulation", "run", "study"]


def study(name, **options):
    """Computes a study and returns the object that `painleve study NAME --json` prints.

    Options are those of that command with `_` for `-`: a number or a text, a list for values separated by commas,
    True for an option without a value, and a dictionary of keys for `set`::

        painleve.study("bifurcation", mu=0.6, v_belt="-0.6:-0.2:0.1", initial=["a", "d"], set={"belt.friction": 0.5})
    """
    arguments = []
    for key, value in options.items():
        option = "--" + key.replace("_", "-")
        if isinstance(value, dict):
            arguments += [f"{option}={inner}={text}" for inner, text in value.items()]
        elif value is True:
            arguments.append(option)
        elif isinstance(value, (list, tuple)):
            arguments.append(f"{option}={','.join(map(str, value))}")
        else:
            arguments.append(f"{option}={value}")
    return json.loads(_painleve.study(name, arguments))

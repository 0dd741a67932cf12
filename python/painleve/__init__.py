"""A robot arm that presses its tip on a moving belt: plant, real-time controller, runs.

A scenario is the name of a built-in one (`painleve scenarios`), a path or a TOML text; `overrides` are keys with values: numbers,
texts, True and False, lists, tuples, arrays, and dictionaries for tables::

    import painleve
    run = painleve.run("edge", {"belt.friction": 0.5})
    painleve.plot(run).savefig("edge.png")
    painleve.sweep("edge", {"belt.friction": [0.4, 0.5, 0.6]})
"""

from ._painleve import Controller, Plant, Simulation, __version__, run, study
from .runs import compare, linearise, plot, sweep

__all__ = ["Controller", "Plant", "Simulation", "compare", "linearise", "plot", "run", "study", "sweep"]

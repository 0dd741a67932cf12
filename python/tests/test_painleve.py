import importlib.metadata
import inspect
from pathlib import Path

import numpy
import painleve
import pytest


def test_a_run_gives_columns_of_equal_length():
    run = painleve.run("hybrid-elbow-down")
    assert len(run["time_s"]) == 6000
    assert {len(column) for column in run.values()} == {6000}
    assert abs(run["plant.tip_t_m"][-1] - 0.148) < 1e-3
    assert set(run["plant.mode"]) == {"slide-positive"}
    assert abs(run["estimates.friction"][-1] - 0.6) < 0.02


def test_overrides_and_mistakes():
    run = painleve.run("edge", {"run.duration_s": 0.1, "belt.friction": 0.5})
    assert len(run["time_s"]) == 100
    with pytest.raises(ValueError, match="belt.friction"):
        painleve.run("edge", {"belt.friction": -1})
    with pytest.raises(ValueError, match="no file is called 'egde'"):
        painleve.run("egde")


def test_a_scenario_is_a_name_a_path_or_a_text(tmp_path):
    text = "belt.friction = 0.5\nrun.duration_s = 0.1\n"
    path = tmp_path / "friction=0.5.toml"
    path.write_text(text)
    assert str(painleve.run(str(path))) == str(painleve.run(text))
    # An object with a path is never taken for a TOML text, nor for the name of a built-in scenario.
    with pytest.raises(ValueError, match="no file is called './edge'"):
        painleve.run(Path("edge"))
    other = tmp_path / "friction=0.5"
    other.write_text(text)
    for make in (painleve.run, painleve.Plant, painleve.Simulation, painleve.Controller):
        make(path)
        with pytest.raises(ValueError, match=f"no file is called '{tmp_path}/none'"):
            make(tmp_path / "none")
        with pytest.raises(TypeError, match="a scenario is a name, a path or a TOML text, not of type int"):
            make(1)
        assert inspect.signature(make).parameters["scenario"].default == "hybrid-elbow-down"
    assert str(painleve.run(path)) == str(painleve.run(other)) == str(painleve.run(text))
    assert len(painleve.sweep(path, {"belt.friction": [0.4, 0.5]})) == 2
    assert painleve.study("admissible", scenario=path) == painleve.study("admissible", scenario=str(path))
    defaults = painleve.Plant("").state()
    assert defaults == painleve.Plant("\n").state() != painleve.Plant("open-loop-bounce").state()


def test_the_package_has_the_names_that_it_lists():
    modules = {"gym", "runs", "_painleve"}
    assert {name for name in dir(painleve) if not name.startswith("__")} - modules == set(painleve.__all__)


def test_the_package_tells_its_version_and_its_classes_their_module():
    assert painleve.__version__ == importlib.metadata.version("painleve")
    for made in (painleve.Plant, painleve.Simulation, painleve.Controller):
        assert made.__module__ == "painleve"


LENGTHS = "arm.link_length_m"


@pytest.mark.parametrize(
    "value",
    [
        [0.2, 0.21],
        (0.2, 0.21),
        numpy.array([0.2, 0.21]),
        numpy.array([0.2, 0.21], numpy.float64)[:, None].ravel(),
        [numpy.float64(0.2), numpy.float64(0.21)],
    ],
)
def test_overrides_take_lists_in_any_form(value):
    plain = painleve.Plant("open-loop-bounce", {LENGTHS: [0.2, 0.21]}).step(0.1, 0.0)
    assert painleve.Plant("open-loop-bounce", {LENGTHS: value}).step(0.1, 0.0) == plain
    assert painleve.Plant("open-loop-bounce").step(0.1, 0.0) != plain


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("belt.friction", numpy.float64(0.5), "0.5"),
        ("belt.friction", numpy.float32(0.5), "0.5"),
        ("belt.friction", numpy.array(0.5), "0.5"),
        ("belt.friction", 1, "1.0"),
        ("run.seed", numpy.int64(7), "7"),
        ("belt.profile", {"kind": "sine", "mean_m_s": -0.4, "amplitude_m_s": numpy.float64(0.1), "frequency_hz": 2},
         "{ kind = 'sine', mean_m_s = -0.4, amplitude_m_s = 0.1, frequency_hz = 2.0 }"),
        ("impact.law", "energetic", "'energetic'"),
        ("effects.gear", {"elastic": False}, "{ elastic = false }"),
        ("effects.gear.elastic", numpy.bool_(False), "false"),
    ],
)  # fmt: skip
def test_overrides_take_values_of_every_kind(key, value, text):
    run = painleve.run("", {"run.duration_s": 0.1, key: value})
    assert str(run) == str(painleve.run(f"run.duration_s = 0.1\n{key} = {text}\n"))


TEXTS = ["123", "", "0.5", "true", "[1, 2]", "two\nlines\r\n", 'a "quoted" \\ text', '"""', "\t\x00\x7f\x85", "ż → 𝜃", "key=value", " # "]


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_remains_a_text(text):
    expected = painleve.Plant("edge").state()
    for key in ("name", "description"):
        assert painleve.Plant("edge", {key: text}).state() == expected
    not_a_number = "^belt.friction: expected a number from 0 to 10, not \""
    with pytest.raises(ValueError, match=not_a_number):
        painleve.Plant("edge", {"belt.friction": text})
    with pytest.raises(ValueError, match=not_a_number):
        painleve.study("robustness", runs=1, set={"belt.friction": text})
    with pytest.raises(ValueError, match="expected a number"):
        painleve.Plant("edge", {LENGTHS: [text, 0.2]})


LOOP = []
LOOP.append(LOOP)


@pytest.mark.parametrize(
    ("overrides", "error", "message"),
    [
        ({"belt.friction": None}, TypeError, "belt.friction: a value of type NoneType"),
        ({"belt.friction": 1j}, TypeError, "belt.friction: a value of type complex"),
        ({"belt.friction": [object()]}, TypeError, "belt.friction: a value of type object"),
        ({"belt.friction": (0.5, 0.6)}, ValueError, "^belt.friction: expected a number from 0 to 10, not a list"),
        ({"belt.friction": float("nan")}, ValueError, "belt.friction = NaN"),
        ({LENGTHS: LOOP}, ValueError, "more than 16 lists"),
        ({"run.seed": 2**63}, ValueError, "run.seed = 9223372036854775808 is out of range"),
        ({"belt.frction": 0.5}, ValueError, "^belt.frction: unknown key 'frction'; did you mean 'friction'"),
        ({"controller.law.pid.x": 1}, ValueError, "choose it first with controller.law=pid"),
        ({1: 0.5}, TypeError, "override 1: a key is a text"),
    ],
)
def test_mistakes_in_overrides_are_named(overrides, error, message):
    for make in (painleve.run, painleve.Plant, painleve.Simulation, painleve.Controller):
        with pytest.raises(error, match=message) as refusal:
            make("edge", overrides)
        assert "--set" not in str(refusal.value)


@pytest.mark.parametrize("torque", [float("nan"), float("inf"), -float("inf")])
def test_a_torque_is_a_finite_number(torque):
    plant = painleve.Plant("edge")
    for torques in ((torque, 0.0), (0.0, torque)):
        with pytest.raises(ValueError, match="finite"):
            plant.step(*torques)
    with pytest.raises(TypeError):
        plant.step("strong", 0.0)
    assert plant.state()["time_s"] == 0.0


def test_controller_and_simulation_make_the_same_run_tick_by_tick():
    overrides = {"run.duration_s": 0.5}
    simulation, controller = painleve.Simulation("capture", overrides), painleve.Controller("capture", overrides)
    tips = []
    for _ in range(500):
        sensor, is_lost = simulation.sample()
        tips.append(simulation.state()["tip_t_m"])
        simulation.advance(None if is_lost else controller.tick(sensor))
    assert tips == painleve.run("capture", overrides)["plant.tip_t_m"]
    assert controller.telemetry()["contact_confidence"] >= 0.0


def test_sample_and_advance_alternate():
    simulation = painleve.Simulation("edge")
    with pytest.raises(RuntimeError, match="sample.. comes before"):
        simulation.advance(None)
    sensor, _ = simulation.sample()
    with pytest.raises(RuntimeError, match="advance.. comes before"):
        simulation.sample()
    simulation.advance(None)
    assert (sensor[0], simulation.sample()[0][0]) == (0, 1)


def test_a_plant_starts_in_the_contact_with_which_a_run_starts():
    for scenario in ("open-loop-bounce", "hybrid-elbow-down"):
        run = painleve.run(scenario, {"run.duration_s": 0.01})
        for state in (painleve.Plant(scenario).state(), painleve.Simulation(scenario).state()):
            assert state["normal_force_n"] >= 0.0
            for name in ("mode", "normal_force_n", "theta1_dot_rad_s"):
                assert state[name] == run[f"plant.{name}"][0]


def test_the_plant_falls_off_the_belt_without_control():
    plant = painleve.Plant("open-loop-bounce")
    while plant.state()["time_s"] < 0.2:
        state = plant.step(0.0, 0.0)
    assert state["gap_m"] > 0.0


def test_a_study_gives_the_object_of_the_command():
    admissible = painleve.study("admissible", mu=0.6)
    assert abs(admissible["elbow_down"]["intervals_m"][0][1] - 0.164705) < 1e-6
    heavier = painleve.study("admissible", mu=0.6, set={"arm.tip_mass_kg": 0.01})
    assert heavier["elbow_down"] != admissible["elbow_down"]
    both = ["arm.tip_mass_kg=0.02", "arm.tip_mass_kg=0.01"]
    assert painleve.study("admissible", mu=0.6, set=both) == heavier
    section = painleve.study(
        "bifurcation", mu=0.6, v_belt=[-0.5, -0.4], initial=["a", "d"], transient_s=1, record_s=1
    )
    assert len(section["rows"]) == 4


def test_a_study_takes_arrays_and_tuples():
    expected = painleve.study("bifurcation", mu="0.5,0.6", v_belt="-0.4", initial="a", transient_s=0.1, record_s=0.1)
    for mu in ([0.5, 0.6], (0.5, 0.6), numpy.array([0.5, 0.6])):
        found = painleve.study("bifurcation", mu=mu, v_belt=numpy.float64(-0.4), initial=("a",), transient_s=0.1, record_s=0.1)
        assert found == expected
    set_ = {"arm.link_length_m": (0.2, 0.21)}
    assert painleve.study("admissible", mu=0.6, set=set_) != painleve.study("admissible", mu=0.6)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("admisible", {}, "unknown study 'admisible': .*admissible"),
        ("bifurcation", {"mu": -1}, "^mu = -1"),
        ("admissible", {"mu": 99}, "^mu = 99"),
        ("stiffness", {"v_belt": -200}, "^v_belt = -200"),
        ("bifurcation", {"v_belt": "-1:-0.1:1e-5", "mu": "0:1:1e-3"}, "rows: at most 10000000"),
        ("admissible", {"nu": 0.6}, "'nu"),
        ("bifurcation", {"v_blt": 0.6}, "'v_blt"),
        ("admissible", {"help": True}, "^help is no option"),
        ("bifurcation", {"mu": "slippery"}, "mu"),
        ("admissible", {"set": {"belt.frction": 1}}, "^belt.frction: unknown key"),
        ("admissible", {"set": {"belt.friction": 1}}, "^belt.friction has no effect here; use mu$"),
    ],
)
def test_mistakes_in_a_study_are_named_as_in_python(name, options, message):
    with pytest.raises(ValueError, match=message) as refusal:
        painleve.study(name, **options)
    assert "--" not in str(refusal.value) and "\n" not in str(refusal.value)

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


def test_the_plant_falls_off_the_belt_without_control():
    plant = painleve.Plant("open-loop-bounce")
    while plant.state()["time_s"] < 0.2:
        state = plant.step(0.0, 0.0)
    assert state["gap_m"] > 0.0


def test_the_environment():
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env
    from painleve.gym import ArmOnBelt

    check_env(ArmOnBelt(), skip_render_check=True)
    environment = ArmOnBelt(duration_s=0.01)
    environment.reset()
    steps = [environment.step([0.5, 0.8])[3] for _ in range(10)]
    assert steps == [False] * 9 + [True]
    assert gymnasium is not None


def test_a_study_gives_the_object_of_the_command():
    admissible = painleve.study("admissible", mu=0.6)
    assert abs(admissible["elbow_down"]["intervals_m"][0][1] - 0.164705) < 1e-6
    heavier = painleve.study("admissible", mu=0.6, set={"arm.tip_mass_kg": 0.01})
    assert heavier["elbow_down"] != admissible["elbow_down"]
    section = painleve.study(
        "bifurcation", mu=0.6, v_belt=[-0.5, -0.4], initial=["a", "d"], transient_s=1, record_s=1
    )
    assert len(section["rows"]) == 4


def test_mistakes_in_a_study_are_named():
    with pytest.raises(ValueError, match="unknown study 'admisible': .*admissible"):
        painleve.study("admisible")
    with pytest.raises(ValueError, match="--mu = -1"):
        painleve.study("bifurcation", mu=-1)
    with pytest.raises(ValueError, match="--nu"):
        painleve.study("admissible", nu=0.6)

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording

POSES = ("position", "heading", "temperature")


def burning():
    """Return a model of 50 robots whose fires last."""
    return FireFighting(n_robots=50, strategy="A", k2=0.001, rng=1)


@pytest.mark.parametrize("columns", [None, POSES], ids=["default", "poses"])
def test_what_recording_adds_to_a_step(benchmark, tmp_path, columns):
    model = burning()
    model.run(10)
    recorder = model.record(tmp_path / "run.arrow", columns=columns)
    model.observers.remove(recorder)
    steps = iter(range(model.completed + 1, 10**9))

    def take_a_step():
        model._completed = next(steps)
        model.sense()  # which the next step would do otherwise

    def record_it():
        recorder.after_step(model, model.completed)
        recorder.between_steps(model)
        recorder.before_step(model)

    benchmark.pedantic(record_it, setup=take_a_step, rounds=5_000, warmup_rounds=10)
    recorder.close()
    assert Recording(tmp_path / "run.arrow").steps[-1] == model.completed


@pytest.mark.slow
def test_finding_a_frame_that_is_not_decoded_yet(benchmark, tmp_path):
    model = burning()
    with model.record(tmp_path / "run.arrow"):
        model.run(3000)
    frame = benchmark(lambda: Recording(tmp_path / "run.arrow")[1500])
    assert frame.step == 1501

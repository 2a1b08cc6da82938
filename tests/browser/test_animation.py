"""Animated drawings in a real browser: robots are where they were, when they were there."""

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.export import export
from support.visits import blank_page

SEEK = """seconds => {
  const drawing = document.documentElement;
  drawing.pauseAnimations();
  drawing.setCurrentTime(seconds);
}"""
# Where the centre of each robot is, in the world's own coordinates, and which way it heads.
POSES = """() => [...document.querySelectorAll('.robot')].map(robot => {
  const {a, b, e, f} = robot.parentNode.getCTM().inverse().multiply(robot.getCTM());
  return [e, f, Math.atan2(b, a)];
})"""

pytestmark = pytest.mark.long


def test_a_browser_shows_robots_where_they_were_recorded(tmp_path, chromium):
    model = FireFighting(n_robots=8, rng=2)
    with model.record(tmp_path / "run.arrow"):
        model.run(120)
    recording = Recording(tmp_path / "run.arrow")
    (path,) = export(recording, tmp_path / "run.svg", animate=True, every=2, first=2, fps=10)
    page = blank_page(chromium)
    page.goto(path.as_uri())
    for place in (0, 1, 30, 58):
        page.evaluate(SEEK, place / 10)
        frame = recording.at(2 + 2 * place)
        for (x, y, heading), at, wanted in zip(page.evaluate(POSES), frame["position"], frame["heading"], strict=True):
            assert (x, y) == pytest.approx(tuple(at), abs=0.06)
            assert abs((heading - wanted + 3.14159) % 6.28318 - 3.14159) < 0.02
    page.close()

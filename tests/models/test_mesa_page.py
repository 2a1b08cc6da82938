"""Every model of the gallery on the page that Mesa itself makes of models."""

import warnings

import mesa
import numpy as np
import pandas as pd
import pytest
import solara

from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.viewing.canvas_widget import swarm_canvas

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # Mesa's and Solara's own, of what they take from each other
    from mesa.visualization import SolaraViz, SpaceRenderer, make_plot_component, make_space_component
    from mesa.visualization.components import AgentPortrayalStyle


QUIET = ("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning", "ignore::FutureWarning")


def dot(agent: mesa.Agent) -> dict:
    return {"color": "tab:blue", "size": 10}


def show(model: mesa.Model, component) -> None:
    """Render Mesa's page of a model once; what goes wrong in it is raised."""
    page = SolaraViz(model, components=[component, make_plot_component("total_collisions")], name="page")
    _, context = solara.render(page, handle_error=False)
    context.close()


@pytest.mark.filterwarnings(*QUIET)
@pytest.mark.parametrize("name", model_names())
class TestEveryModelOnMesasPage:
    @pytest.mark.slow
    def test_is_drawn_by_the_canvas_of_this_package(self, name):
        model, shown = find_model(name)(n_robots=4, rng=1), []

        def canvas(model):
            shown.append(model)
            return swarm_canvas(model)

        show(model, canvas)
        assert shown[0] is model

    @pytest.mark.slow
    def test_is_drawn_by_mesa_with_all_its_agents_where_they_are(self, name):
        model, places = find_model(name)(n_robots=4, rng=1).run(3), []

        def look(axes):
            places.extend(point for drawn in axes.collections for point in np.asarray(drawn.get_offsets()).tolist())

        show(model, make_space_component(dot, post_process=look))
        # All that are in the space: a body stands for an agent that is not, such as a sheep.
        wanted = [agent.position.tolist() for agent in model.space.agents]
        assert {agent for agent in model.agents if hasattr(agent, "space")} == set(model.space.agents)
        assert sorted(places) == sorted(wanted)

    @pytest.mark.slow
    def test_goes_on_after_it_was_shown_as_if_it_had_not_been(self, name):
        seen, unseen = (find_model(name)(n_robots=4, rng=1).run(3) for _ in range(2))
        show(seen, swarm_canvas)
        assert seen.run(3).state_hash() == unseen.run(3).state_hash()


def styled(agent: mesa.Agent) -> AgentPortrayalStyle:
    return AgentPortrayalStyle(color="tab:blue", size=10)


def places_drawn(backend: str, model: mesa.Model) -> list:
    renderer = SpaceRenderer(model, backend=backend)
    renderer.draw_agents(styled)
    if backend == "matplotlib":
        drawn = [np.asarray(one.get_offsets()).tolist() for one in renderer.canvas.collections]
        return [point for points in drawn for point in points]
    return [[row["x"], row["y"]] for rows in renderer.canvas.to_dict()["datasets"].values() for row in rows]


OLD_ALTAIR = mesa.__version__.startswith("3.3") and int(pd.__version__.partition(".")[0]) >= 3


@pytest.mark.filterwarnings(*QUIET)
class TestMesasRenderer:
    @pytest.mark.parametrize("backend", ["matplotlib", "altair"])
    def test_draws_all_agents_where_they_are(self, backend):
        model = find_model("fire_fighting")(n_robots=4, rng=1).run(3)
        texts = ("future.infer_string", not OLD_ALTAIR)  # see docs/mesa.md
        with pd.option_context(*texts):
            drawn = places_drawn(backend, model)
        assert sorted(drawn) == sorted(agent.position.tolist() for agent in model.space.agents)

    @pytest.mark.skipif(not OLD_ALTAIR, reason="only with Mesa 3.3 and pandas 3")
    def test_of_mesa_3_3_fails_with_altair_and_pandas_3_as_the_page_describes(self):
        with pytest.raises(TypeError, match="Cannot interpret '<StringDtype"):
            places_drawn("altair", find_model("fire_fighting")(n_robots=4, rng=1))

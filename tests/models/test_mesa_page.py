"""Every model of the gallery on the page that Mesa itself makes of models."""

import warnings

import mesa
import numpy as np
import pytest
import solara

from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.viewing.canvas_widget import swarm_canvas

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # Mesa's and Solara's own, of what they take from each other
    from mesa.visualization import SolaraViz, make_plot_component, make_space_component


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
    def test_is_drawn_by_the_canvas_of_this_package(self, name):
        model, shown = find_model(name)(n_robots=4, rng=1), []

        def canvas(model):
            shown.append(model)
            return swarm_canvas(model)

        show(model, canvas)
        assert shown[0] is model

    def test_is_drawn_by_mesa_with_all_its_agents_where_they_are(self, name):
        model, places = find_model(name)(n_robots=4, rng=1).run(3), []

        def look(axes):
            places.extend(point for drawn in axes.collections for point in np.asarray(drawn.get_offsets()).tolist())

        show(model, make_space_component(dot, post_process=look))
        # All that are in the space: a body stands for an agent that is not, such as a sheep.
        wanted = [agent.position.tolist() for agent in model.space.agents]
        assert {agent for agent in model.agents if hasattr(agent, "space")} == set(model.space.agents)
        assert sorted(places) == sorted(wanted)

    def test_goes_on_after_it_was_shown_as_if_it_had_not_been(self, name):
        seen, unseen = (find_model(name)(n_robots=4, rng=1).run(3) for _ in range(2))
        show(seen, swarm_canvas)
        assert seen.run(3).state_hash() == unseen.run(3).state_hash()

"""SwarmModel: the engine's model with fires, and methods to record, resume, verify and show it; `show`."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

from mesa_swarm.base.composer import composer
from mesa_swarm.base.errors import InvalidValueError, SwarmError, shortened
from mesa_swarm.base.extras import missing_package_line
from mesa_swarm.base.lazy import ImportedMethod
from mesa_swarm.base.streams import Seed
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.fire.constants import FireConstants, design_constants
from mesa_swarm.fire.fires import Fires
from mesa_swarm.fire.fires_part import FiresPart
from mesa_swarm.maps.map import Map
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parts import delegate

if TYPE_CHECKING:  # optional, or slow to load
    from mesa_swarm.model.info import ModelInfo
    from mesa_swarm.recording.continuing import continued
    from mesa_swarm.recording.recorder import record
    from mesa_swarm.recording.verify import Verification


class SwarmModel(EngineModel, shows_all=True):
    """A world of robots, obstacles and fires, advanced step by step.

    Parameters
    ----------
    map : str, path or Map
        A built-in map (original, sparse, openspace, openspace_fire), a file (.toml, .svg, .map), or a Map.
    rng : int, SeedSequence, Generator or None
        Seed of everything random. The same seed gives the same bits.
    engine : str
        "compiled", or "shapely": slow and readable, the oracle of the first.
    threads : int, optional
        How many threads share each step of a world with hundreds of robots, 1 to 256; by default the number in the
        environment variable MESA_SWARM_THREADS, or 1. The bits are the same for any number.
    turn_angle_degrees : float
        A robot that meets a flat side at more than this from its normal is turned parallel to it; 0 to 90.
    fire_constants : FireConstants, optional
        From `design_constants`, whose defaults are used otherwise.
    extinguish_range : float
        A robot whose body is this near to a fire's edge can fight it and takes its heat, at least 0.
    history_every : int
        Steps between two rows of `fires.history`; 0 for no rows.
    collect_every : int
        Steps between two rows of `datacollector`, 1 for each step; 0 collects nothing.
    communication : Radio, optional
        How robots broadcast to each other; by default they do not.
    noise, slip, imperfections : float
        Of imperfect robots, each 0 to 1: relative error of every sensor; probability, per wheel and step, that a wheel
        loses half its speed; a place of the dial from ideal robots, 0, to `MEASURED`, 1. Every subclass takes these
        three, whether it declares them or not.
    model_reporters, agent_reporters : dict, optional
        More of what Mesa's DataCollector collects, besides `collisions` and
        `total_collisions`.
    scale : Scale, optional
        How long a metre and a step are, which pictures, charts and tables show.

    Attributes
    ----------
    swarm : Swarm
        The robots' columns.
    fires : Fires
        The fires' columns.
    space : Arena
    datacollector : mesa.DataCollector
    steps : int
        How many steps were begun, with every version of Mesa.
    scenario : mesa.experimental.scenarios.Scenario
        From Mesa 3.5 on. A model of any class that is made with ``scenario=Scenario(rng=1, ...)`` has its values as
        parameters and seed.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> from mesa_swarm.control import Avoid, Explore, Subsumption
    >>> model = SwarmModel(map="original", rng=1)
    >>> robots = model.add_robots(AGENT9, 5)
    >>> model.control = Subsumption(Avoid(distance=15), Explore())
    >>> model.run(10).steps
    10
    """

    if TYPE_CHECKING:  # a type checker does not see the parameters of `EngineModel`, which are common to all classes

        def __init__(self, *, map: str | os.PathLike | Map = "openspace", rng: Seed = None, **common: Any) -> None: ...

    else:

        def __init__(
            self,
            *,
            map: str | os.PathLike | Map = "openspace",
            rng: Seed = None,
            fire_constants: FireConstants | None = None,
            extinguish_range: float = 10.0,
            history_every: int | Trigger = 1,
        ) -> None:
            super().__init__(map=map, rng=rng)
            constants = design_constants() if fire_constants is None else fire_constants
            self.parts.stand(FiresPart(self, constants, extinguish_range, history_every), before="processes")
            for spot in self.map.fires:
                self.add_fire(spot.position, radius=spot.radius, temperature=spot.temperature)

    def __repr__(self) -> str:
        counts = f"{len(self.swarm)} robots, {len(self.fires)} fires"
        return f"<{type(self).__name__} on map {self.map.name}, step {self.steps}: {counts}>"

    @property
    def fires(self) -> Fires:
        """The fires' columns, and their handles by index."""
        return self.parts.fires.fires

    @property
    def extinguish_range(self) -> float:
        """A robot whose body is this near to a fire's edge can fight it and takes its heat; may be changed."""
        return self.parts.fires.extinguish_range

    @extinguish_range.setter
    def extinguish_range(self, extinguish_range: float) -> None:
        self.parts.fires.extinguish_range = extinguish_range

    @property
    def fire_constants(self) -> FireConstants:
        """The constants of the fires and of the heat in robots; may be changed between steps."""
        return self.parts.fires.constants

    @fire_constants.setter
    def fire_constants(self, constants: FireConstants) -> None:
        self.parts.fires.set_constants(constants)

    add_fire = delegate("fires", FiresPart.add_fire)

    if TYPE_CHECKING:
        record, continued = record, continued
    else:  # slow to load
        record = ImportedMethod("recording.recorder")
        continued = ImportedMethod("recording.continuing")

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], *, step: int | None = None, progress: bool = False, **changes: object
    ) -> Self:
        """Return the model as it was after a step of a recording; see `mesa_swarm.recording.resume`.

        Parameters
        ----------
        path : str or Path
        step : int, optional
            By default the last one recorded.
        progress : bool
            Whether to show a bar.
        **changes
            Parameters of the model that differ from then on.

        Returns
        -------
        SwarmModel
            Of this class. At a step after which something was changed by hand, with that change.
        """
        from mesa_swarm.recording.resume import resume  # noqa: PLC0415 - slow to load

        return resume(cls, path, step=step, progress=progress, **changes)

    @classmethod
    def verify(cls, path: str | os.PathLike[str], *, progress: bool = False) -> "Verification":
        """Run a recorded model again and compare every row; see `mesa_swarm.recording.verify`.

        Parameters
        ----------
        path : str or Path
            Of a recording of this class, or of one that is derived from it.
        progress : bool
            Whether to show a bar.

        Returns
        -------
        Verification
        """
        from mesa_swarm.recording.recording import Recording  # noqa: PLC0415 - slow to load
        from mesa_swarm.recording.resume import class_of  # noqa: PLC0415
        from mesa_swarm.recording.verify import verify  # noqa: PLC0415

        recording = Recording(path)
        return verify(recording, class_of(recording, cls), progress)

    @classmethod
    def info(cls) -> "ModelInfo":
        """Return what the model is, how it works, and what to try; see `mesa_swarm.model_info`.

        Returns
        -------
        ModelInfo
            As the last line of a cell of a notebook it is shown as text with equations and code.
        """
        from mesa_swarm.model.info import model_info  # noqa: PLC0415 - rarely needed

        return model_info(cls)

    export = ImportedMethod("live.live_page")

    def show(
        self,
        *,
        controls: bool | Sequence[str] = False,
        charts: bool | Sequence[str] = False,
        inspector: bool = False,
        reset: bool = False,
        width: int | None = None,
        height: int = 560,
        speed: float = 60.0,
    ) -> Any:
        """Return a widget for notebooks that shows and plays the model; needs the extra `dashboard`.

        Steps that a program takes are shown as well. Where widgets do not work, and in a stored notebook without a
        kernel, a picture is shown.

        Parameters
        ----------
        controls : bool or list of str
            Whether there are sliders, lists and fields of all parameters, or of those named, and a Reset button.
        charts : bool or list of str
            Whether charts of the run are shown, or which: names of reporters, of the model's own charts, or
            "at_fires", "fire_temperature", "layers", "events".
        inspector : bool
            Whether the robot that was clicked on is described.
        reset : bool
            Whether a Reset button begins the run anew.
        width, height : int
            Of the widget, 200 and 100 to 10,000 pixels; by default it is as wide as the cell.
        speed : float
            Steps a second when it is played, above 0, at most 1000.

        Returns
        -------
        SwarmCanvas or NotebookView
            The second with any of the first four options. Reset builds another model from the settings, which is then
            its attribute `model`; the one that was shown remains as it is. A `SwarmModel` of no class of its own got
            its robots afterwards: it is copied when it is shown, and Reset returns to that.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> type(SwarmModel(rng=1).show()).__name__
        'SwarmCanvas'
        >>> view = SwarmModel(rng=1).show(charts=["collisions"], reset=True, height=400)
        >>> view.model.steps
        0
        """
        try:
            from mesa_swarm.viewing.canvas_widget import Beside, show_canvas  # noqa: PLC0415 - optional
        except ModuleNotFoundError as error:
            raise SwarmError(missing_package_line("show needs", error.name or "a package", "dashboard")) from error
        beside = Beside(controls=controls, charts=charts, inspector=inspector, reset=reset)
        if not beside:
            return show_canvas(self, speed=speed, width=width, height=height)
        return composer()(self, beside, speed=speed, width=width, height=height)


def show(
    model: SwarmModel | type[SwarmModel] | str,
    *,
    controls: bool | Sequence[str] = False,
    charts: bool | Sequence[str] = False,
    inspector: bool = False,
    reset: bool = False,
    width: int | None = None,
    height: int = 560,
    speed: float = 60.0,
    **parameters: Any,
) -> Any:
    """Return a widget for notebooks that shows and plays a model; see `SwarmModel.show`.

    Parameters
    ----------
    model : SwarmModel, class or str
        A model, or the class, name or address of one, which is then made: see `gallery.find_model`.
    controls, charts, inspector, reset, width, height, speed
        As those of `SwarmModel.show`.
    **parameters
        Of the model that is made, such as `n_robots` and `rng`.

    Returns
    -------
    SwarmCanvas or NotebookView

    Examples
    --------
    >>> type(show("fire_fighting", n_robots=4, rng=1)).__name__
    'SwarmCanvas'
    >>> view = show("fire_fighting", n_robots=4, rng=1, controls=["n_robots", "strategy"], charts=True, inspector=True)
    >>> len(view.model.robots)
    4
    """
    value = find_model(model) if isinstance(model, str) else model
    if isinstance(value, type) and issubclass(value, SwarmModel):
        value = value(**parameters)
    elif parameters:
        raise InvalidValueError(f"{', '.join(parameters)}: given beside a model that is made already; give its class")
    if not isinstance(value, SwarmModel):
        raise InvalidValueError(f"model is {shortened(value)}; expected a SwarmModel, or its class, name or address")
    return value.show(
        controls=controls, charts=charts, inspector=inspector, reset=reset, width=width, height=height, speed=speed
    )

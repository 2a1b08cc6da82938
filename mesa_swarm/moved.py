"""Old addresses: modules that were merged or moved are imported from their new place, with a warning."""

import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

ROOT = "mesa_swarm."
# New module: the modules of earlier versions that are in it now.
MOVED = {
    "analysis.chain_history": "analysis.chain_events analysis.meetings",
    "analysis.pathology": "analysis.pathology_finders analysis.pathology_track",
    "analysis.series": "analysis.collisions",
    "control.arbiter": "control.subsumption control.vector_sum",
    "control.behaviour": "control.rule_source",
    "control.flocking": "control.apparent control.boids control.match_velocity",
    "control.layer": "control.perception",
    "control.rule": "control.readings",
    "environments.registration": "environments.extra",
    "environments.scores": "environments.observation",
    "environments.task_world": "environments.commanded",
    "experiments.diagnosis": "experiments.oscillation",
    "experiments.figures": "experiments.comparison_figures",
    "experiments.learning_figures": "experiments.fire_figures experiments.reward_figures",
    "experiments.tables": "experiments.findings",
    "fire.part": "fire.model",
    "learning.fire_learning": "learning.skills",
    "learning.learner": "learning.keeping learning.memory",
    "learning.networks": "learning.network_policy",
    "learning.policy": "learning.told",
    "learning.q_learning": "learning.q_policy",
    "learning.reflex_policy": "learning.mirror",
    "learning.wire_learning": "learning.wire_fitting learning.wire_policy",
    "model.bodies": "body_world",
    "model.engine_model": "world_model",
    "model.events": "events",
    "model.imperfections": "imperfect_model",
    "model.mesa_model": "mesa_model",
    "model.observers": "observers",
    "model.processes": "open_model",
    "model.state": "state",
    "model.state_hash": "state_hash",
    "recording.changes": "recording.interventions recording.marks",
    "recording.frames": "recording.events",
    "robots.design": "robots.table",
    "robots.devices": "robots.parts",
    "robots.drive": "robots.steering",
    "teaching.checks": "teaching.failures teaching.verdict teaching.wish",
    "teaching.pictures": "teaching.sizes",
    "viewing.canvas_widget": "dashboard.canvas_widget dashboard.notebook",
    "viewing.export": "exports",
    "viewing.pictures": "experiments.pictures",
    "viewing.run_pictures": "experiments.run_pictures",
    "world.bodies": "world.form world.load world.obstacle",
}
HOMES = {ROOT + old: ROOT + new for new, olds in MOVED.items() for old in olds.split()}
# Single names that moved or have another name now.
NAMES = {
    "mesa_swarm.analysis.Event": "mesa_swarm.analysis.ChainEvent",
    "mesa_swarm.body_world.BodyWorld": "mesa_swarm.model.engine_model.EngineModel",
    "mesa_swarm.environments.observation.Observer": "mesa_swarm.environments.scores.ObservationEncoder",
    "mesa_swarm.fire.model.FireModel": "mesa_swarm.swarm_model.SwarmModel",
    "mesa_swarm.imperfect_model.COMMON": "mesa_swarm.model.common.COMMON",
    "mesa_swarm.imperfect_model.ImperfectModel": "mesa_swarm.model.engine_model.EngineModel",
    "mesa_swarm.model.ENGINES": "mesa_swarm.model.engine_model.ENGINES",
    "mesa_swarm.model.EngineModel": "mesa_swarm.model.engine_model.EngineModel",
    "mesa_swarm.model.REPORTERS": "mesa_swarm.model.engine_model.REPORTERS",
    "mesa_swarm.model.SwarmModel": "mesa_swarm.swarm_model.SwarmModel",
    "mesa_swarm.open_model.OpenModel": "mesa_swarm.model.engine_model.EngineModel",
    "mesa_swarm.recording.marks.Mark": "mesa_swarm.recording.changes.ChangeDetector",
    "mesa_swarm.robots.parts.RobotPart": "mesa_swarm.robots.devices.Device",
    "mesa_swarm.teaching.Wish": "mesa_swarm.teaching.checks.Criterion",
    "mesa_swarm.teaching.checks.Wish": "mesa_swarm.teaching.checks.Criterion",
    "mesa_swarm.teaching.wish.Wish": "mesa_swarm.teaching.checks.Criterion",
    "mesa_swarm.world_model.World": "mesa_swarm.model.engine_model.EngineModel",
}


class MovedFinder:
    """Finds moved modules; it stands last in ``sys.meta_path``, so that it is called only for what is not found."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Return how a module is made, None if it was not moved."""
        return ModuleSpec(name, self) if name in HOMES else None  # type: ignore[arg-type]  # a loader by its methods

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python to make an empty module."""

    def exec_module(self, module: ModuleType) -> None:
        """Fill it with the names of its new home."""
        old = module.__name__
        _warn(old, HOMES[old], stacklevel=3)
        names = {name: value for name, value in vars(import_module(HOMES[old])).items() if not name.startswith("__")}
        for address, new in NAMES.items():
            home, _, name = address.rpartition(".")
            if home == old:
                names[name] = _imported(new)
        module.__dict__.update(names)


def moved_name(module: str, name: str) -> object:
    """Return a name that was in a module before, from its new home; for the ``__getattr__`` of that module."""
    old = f"{module}.{name}"
    if old not in NAMES:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    _warn(old, NAMES[old], stacklevel=4)
    return _imported(NAMES[old])


def _imported(address: str) -> object:
    module, _, name = address.rpartition(".")
    return getattr(import_module(module), name)


def _warn(old: str, new: str, stacklevel: int) -> None:
    warnings.warn(f"{old} is deprecated; it is {new} now", DeprecationWarning, stacklevel)

"""Old addresses: modules that were merged or moved are imported from their new place, with a warning until 0.3.

The studies, beside the package, are named as any other place: only a program that uses an old name imports them.
"""

import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import CodeType, ModuleType

ROOT, ROOT_OF_STUDIES = "mesa_swarm.", "mesa_swarm_studies."
# New module: the modules of earlier versions that are in it now.
MOVED = {
    "__main__": "cli.__main__",
    "analysis.chain_history": "analysis.chain_events analysis.meetings",
    "analysis.pathology": "analysis.pathology_finders analysis.pathology_track",
    "analysis.series": "analysis.collisions",
    "cli.run": "cli.check",
    "control.arbiter": "control.subsumption control.vector_sum",
    "control.behaviour": "control.rule_source",
    "control.flocking": "control.apparent control.boids control.match_velocity",
    "control.layer": "control.perception",
    "control.rule": "control.readings",
    "environments.registration": "environments.extra",
    "environments.scores": "environments.observation",
    "environments.task_world": "environments.roster environments.commanded",
    "experiments.diagnosis": "experiments.oscillation",
    "experiments.figures": "experiments.comparison_figures experiments.study_figures",
    "experiments.learning_figures": "experiments.fire_figures experiments.reward_figures",
    "experiments.tables": "experiments.findings",
    "fire.fires_part": "fire.model",
    "learning.fire_learning": "learning.skills",
    "learning.learner": "learning.keeping learning.memory",
    "learning.networks": "learning.forgetting learning.network_policy",
    "learning.policy": "learning.told",
    "learning.q_learning": "learning.q_policy",
    "learning.reflex_policy": "learning.mirror",
    "learning.table_learning": "learning.value_tables",
    "learning.wire_learning": "learning.wire_fitting learning.wire_policy",
    "model.bodies_part": "body_world",
    "model.engine_model": "world_model",
    "model.events": "events",
    "model.imperfections_part": "imperfect_model",
    "model.mesa_model": "mesa_model",
    "model.observers": "observers",
    "model.processes": "open_model",
    "model.state": "state",
    "model.state_hash": "state_hash",
    "physics.shapely_engine": "physics.shapely_sensing",
    "recording.changes": "recording.hand_moves recording.interventions recording.marks",
    "recording.frames": "recording.events",
    "recording.stored_values": "recording.attributes",
    "robots.design": "robots.table",
    "robots.devices": "robots.parts",
    "robots.drive": "robots.steering",
    "teaching.checks": "teaching.hints teaching.faults teaching.failures teaching.verdict teaching.wish",
    "teaching.pictures": "teaching.sizes",
    "viewing.canvas_widget": "dashboard.canvas_widget dashboard.notebook",
    "viewing.drawing": "dashboard.gallery_drawing viewing.animation",
    "viewing.export": "exports",
    "viewing.pictures": "experiments.pictures",
    "viewing.run_pictures": "experiments.run_pictures",
    "world.bodies": "world.form world.load world.obstacle",
}
# Former folder > new folder: the modules that went from one to the other, with their new names where these differ.
FOLDERS = {
    " > base": "composer extras files lazy moved progress streams trigger wording work_done:work_line",
    " > model": "about:info looks odd parameters reporters scattering",
    "dashboard > dashboard": "events_view:app",
    "dashboard > dashboard.compare": "compare_view comparing pair:comparing",
    "dashboard > dashboard.experiment": "experiment_results experiment_view experimenting many_runs",
    "dashboard > dashboard.gallery": "gallery_pictures gallery_view",
    "dashboard > dashboard.page": (
        "addresses:navigation controls edits inputs:session layout:widgets live_run:edits navigation "
        "recorded_series:series robot_columns series session widgets"
    ),
    "dashboard > dashboard.replay": "listed_recordings:replaying replay_view replaying",
    "dashboard > dashboard.run": "chart_content:charts charts editing exporting info_view inspector",
    "environments > environments": "camera:rendering",
    "experiments > experiments": "pool:worker_pool workers:worker_tasks",
    "experiments > searches": (
        "adaptive calibration design:automatic_design design_gap diversity driving:drive_measures "
        "evolution:evolved_controllers gating:validation_gate sensitivity tuning"
    ),
    "fire > fire": "part:fires_part",
    "geometry > geometry": "exact:exact_rounding masks:masked_arrays packing:spaced_points room:free_room",
    "geometry > kernels": (
        "apart:compiled block code_files compiled compiling custom_code precompile type_names waiting"
    ),
    "physics > physics": (
        "imperfect:disturbances motion:arcs moving:driven_bodies packed:stage_kernels radio:broadcasts settle:placing"
    ),
    "viewing > viewing": "faults:error_lines headers:server_headers packing:frame_bytes",
    "world > maps": "map map_parts map_svg:svg map_toml:toml svg_paths:svg",
}
# Addresses that stay, for programs: module, and where its source is.
STAYING = {"errors": "base.errors", "gallery": "model.gallery", "world.random_map": "maps.random_map"}
# Module of the studies: where it was in the package.
STUDIES = {
    "benchmarks.benchmark_tasks": "experiments.benchmark_tasks",
    "benchmarks.contestants": "experiments.contestants",
    "benchmarks.fire_policies": "experiments.fire_policies",
    "benchmarks.learn_bench": "experiments.learn_bench",
    "benchmarks.learn_report": "experiments.learn_report",
    "benchmarks.overhead": "experiments.overhead",
    "benchmarks.ppo": "experiments.ppo",
    "benchmarks.speed": "experiments.bench",
    "benchmarks.task_contestants": "experiments.task_contestants",
    "drawing": "reproduction.drawing",
    "judging": "reproduction.judging",
    "laboratory": "reproduction.laboratory",
    "published.bodies": "reproduction.published_bodies",
    "published.decisions": "reproduction.published",
    "published.pucks": "reproduction.published_pucks",
    "published.trails": "reproduction.published_trails",
    "registry": "reproduction.registry",
    "theory.courses": "reproduction.courses",
    "theory.flocks": "reproduction.theory_flocks",
    "theory.kinetics": "reproduction.theory_kinetics",
    "theory.motion": "reproduction.theory_motion",
    "theory.sensing": "reproduction.theory_sensing",
    "thesis.avoidance": "reproduction.avoidance",
    "thesis.complexity": "reproduction.complexity",
    "thesis.differences": "reproduction.differences",
    "thesis.fire_company": "reproduction.fire_company",
    "thesis.fire_fighting": "reproduction.fire_fighting",
    "thesis.fire_growth": "reproduction.fire_growth",
    "thesis.foresight": "reproduction.foresight",
    "thesis.learning": "reproduction.learning",
    "thesis.maps": "reproduction.maps",
    "thesis.networks": "reproduction.networks",
    "thesis.oscillations": "reproduction.oscillations",
    "thesis.readings": "reproduction.readings",
    "thesis.swarms": "reproduction.swarms",
    "thesis.tuning": "reproduction.tuning",
}


def _homes_of_folders() -> dict[str, str]:
    """Return the new address of each module of `FOLDERS` by its former one."""
    homes = {}
    for folders, modules in FOLDERS.items():
        former, new = folders.split(" > ")
        for module in modules.split():
            old_name, _, new_name = module.partition(":")
            homes[f"{ROOT}{former}.{old_name}".replace("..", ".")] = f"{ROOT}{new}.{new_name or old_name}"
    return homes


HOMES = {
    **{ROOT + old: ROOT + new for new, olds in MOVED.items() for old in olds.split()},
    **{ROOT + old: ROOT + new for old, new in STAYING.items()},
    **_homes_of_folders(),
    **{ROOT + old: ROOT_OF_STUDIES + new for new, old in STUDIES.items()},
}
# A folder in which all modules have moved.
EMPTY = ROOT + "reproduction"
# Single names that moved or have another name now.
NAMES = {
    "mesa_swarm.analysis.Event": "mesa_swarm.analysis.ChainEvent",
    "mesa_swarm.body_world.BodyWorld": "mesa_swarm.model.engine_model.EngineModel",
    "mesa_swarm.dashboard.notebook.show": "mesa_swarm.viewing.canvas_widget.show_canvas",
    "mesa_swarm.environments.observation.Observer": "mesa_swarm.environments.scores.ObservationEncoder",
    "mesa_swarm.experiments.learning_figures.regression_figure": "mesa_swarm_studies.thesis.networks.regression_figure",
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
        if name in HOMES or name == EMPTY:
            return ModuleSpec(name, self, is_package=name == EMPTY)  # type: ignore[arg-type]  # a loader by its methods
        return None

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python to make an empty module."""

    def exec_module(self, module: ModuleType) -> None:
        """Fill it with the names of its new home."""
        old = module.__name__
        if old == EMPTY:
            return
        if old.removeprefix(ROOT) not in STAYING:
            _warn(old, HOMES[old], stacklevel=3)
        contents = vars(import_module(HOMES[old]))
        names = {name: value for name, value in contents.items() if name == "__all__" or not name.startswith("__")}
        for address, new in NAMES.items():
            home, _, name = address.rpartition(".")
            if home == old:
                names[name] = _import_name(new)
        module.__dict__.update(names)

    def get_code(self, name: str) -> CodeType:
        """Return what `python -m` runs: the module in its new home."""
        _warn(name, HOMES[name], stacklevel=3)
        return compile(f"from runpy import run_module as r; r({HOMES[name]!r}, None, '__main__', True)", name, "exec")


def moved_name(module: str, name: str) -> object:
    """Return a name that was in a module before, from its new home; for the ``__getattr__`` of that module."""
    old = f"{module}.{name}"
    if old not in NAMES:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    _warn(old, NAMES[old], stacklevel=4)
    return _import_name(NAMES[old])


def _import_name(address: str) -> object:
    module, _, name = address.rpartition(".")
    return getattr(import_module(module), name)


def _warn(old: str, new: str, stacklevel: int) -> None:
    warnings.warn(f"{old} is deprecated; it is {new} now", DeprecationWarning, stacklevel)

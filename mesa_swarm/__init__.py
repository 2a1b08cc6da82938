"""Swarms of small mobile robots in a continuous plane, for Mesa.

Names are imported when they are first used, so that ``import mesa_swarm`` is quick.
"""

import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

# In an editable installation a link leads here: modules, and machine code stored by their paths, have one path only.
__path__[:] = map(os.path.realpath, __path__)

from mesa_swarm.base.composer import provide_composer
from mesa_swarm.base.lazy import lazy_names
from mesa_swarm.base.moved import MovedFinder

__version__ = "0.3.0"

if not any(isinstance(finder, MovedFinder) for finder in sys.meta_path):
    sys.meta_path.append(MovedFinder())


def _composer() -> Callable[..., Any]:
    from mesa_swarm.dashboard.notebook_panels import show_with_panels  # noqa: PLC0415 - slow to load

    return show_with_panels


provide_composer(_composer)

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.base.streams import Seed, Streams
    from mesa_swarm.experiments.batch import batch_run
    from mesa_swarm.experiments.compare import compare
    from mesa_swarm.experiments.sweep import sweep
    from mesa_swarm.experiments.warm_up import warm_up
    from mesa_swarm.kernels.draws import draw_number
    from mesa_swarm.kernels.part import Column, Context, Part, Phase, Shown, Stage
    from mesa_swarm.maps.map import Map
    from mesa_swarm.model.compiled_stages import compiled_stage
    from mesa_swarm.model.function_measures import measure
    from mesa_swarm.model.info import ModelInfo, model_info
    from mesa_swarm.model.looks import Chart, ColourMap, Looks
    from mesa_swarm.model.measures import ColumnMeasure, count, mean, share, until, until_zero, value
    from mesa_swarm.model.parameters import Choice, Slider
    from mesa_swarm.model.previous import Previous
    from mesa_swarm.model.process_rule import ProcessRule, process
    from mesa_swarm.model.processes import Process
    from mesa_swarm.model.reporters import event_count, event_total, held
    from mesa_swarm.model.scattering import Wander, scatter
    from mesa_swarm.model.worlds import drive
    from mesa_swarm.physics.neighbours import NeighbourSensor
    from mesa_swarm.recording.recording import Recording
    from mesa_swarm.robots.actuators import Actuator, Emitter, Lamp
    from mesa_swarm.robots.design import AGENT3, AGENT6, AGENT9, AGENT_FIRE, AGENT_HEAT, RobotDesign, all_round
    from mesa_swarm.robots.drive import DifferentialDrive, DirectedSlip, HolonomicDrive, OmniDrive, omni_speeds
    from mesa_swarm.robots.gripper import Carried, Gripper
    from mesa_swarm.robots.radio import Radio
    from mesa_swarm.robots.real_robots import (
        E_PUCK,
        I_SWARM,
        KHEPERA_4,
        KILOBOT,
        REAL_ROBOTS,
        S_BOT,
        THYMIO_2,
        TURTLEBOT_3,
        RealRobot,
        Scale,
    )
    from mesa_swarm.robots.sensors import (
        FieldSensor,
        LineSensor,
        ProximitySensor,
        RadiationSensor,
        Sensor,
        bump_sensor,
        laser_sensor,
    )
    from mesa_swarm.searches.adaptive import AdaptiveDesign
    from mesa_swarm.searches.calibration import calibrate
    from mesa_swarm.searches.sensitivity import sensitivity
    from mesa_swarm.swarm_model import SwarmModel, show
    from mesa_swarm.world.fields import Field, ScalarField
    from mesa_swarm.world.shapes import Shape, disc, polygon, rectangle

# Module: the public names that live in it.
_MODULES = {
    "model.info": "ModelInfo model_info",
    "experiments.batch": "batch_run",
    "searches.adaptive": "AdaptiveDesign",
    "searches.calibration": "calibrate",
    "experiments.compare": "compare",
    "searches.sensitivity": "sensitivity",
    "experiments.sweep": "sweep",
    "experiments.warm_up": "warm_up",
    "model.looks": "Chart ColourMap Looks",
    "kernels.draws": "draw_number",
    "kernels.part": "Column Context Part Phase Shown Stage",
    "base.streams": "Seed Streams",
    "model.parameters": "Choice Slider",
    "model.compiled_stages": "compiled_stage",
    "model.function_measures": "measure",
    "model.measures": "ColumnMeasure count mean share until until_zero value",
    "model.previous": "Previous",
    "model.process_rule": "ProcessRule process",
    "model.processes": "Process",
    "model.reporters": "event_count event_total held",
    "recording.recording": "Recording",
    "physics.neighbours": "NeighbourSensor",
    "robots.actuators": "Actuator Emitter Lamp",
    "robots.design": "AGENT3 AGENT6 AGENT9 AGENT_FIRE AGENT_HEAT RobotDesign all_round",
    "robots.drive": "DifferentialDrive DirectedSlip HolonomicDrive OmniDrive omni_speeds",
    "robots.gripper": "Carried Gripper",
    "robots.radio": "Radio",
    "robots.real_robots": "E_PUCK I_SWARM KHEPERA_4 KILOBOT REAL_ROBOTS RealRobot S_BOT Scale THYMIO_2 TURTLEBOT_3",
    "robots.sensors": "FieldSensor LineSensor ProximitySensor RadiationSensor Sensor bump_sensor laser_sensor",
    "model.scattering": "Wander scatter",
    "model.worlds": "drive",
    "swarm_model": "SwarmModel show",
    "world.fields": "Field ScalarField",
    "maps.map": "Map",
    "world.shapes": "Shape disc polygon rectangle",
}

__all__ = [
    "AGENT3",
    "AGENT6",
    "AGENT9",
    "AGENT_FIRE",
    "AGENT_HEAT",
    "E_PUCK",
    "I_SWARM",
    "KHEPERA_4",
    "KILOBOT",
    "REAL_ROBOTS",
    "S_BOT",
    "THYMIO_2",
    "TURTLEBOT_3",
    "Actuator",
    "AdaptiveDesign",
    "Carried",
    "Chart",
    "Choice",
    "ColourMap",
    "Column",
    "ColumnMeasure",
    "Context",
    "DifferentialDrive",
    "DirectedSlip",
    "Emitter",
    "Field",
    "FieldSensor",
    "Gripper",
    "HolonomicDrive",
    "Lamp",
    "LineSensor",
    "Looks",
    "Map",
    "ModelInfo",
    "NeighbourSensor",
    "OmniDrive",
    "Part",
    "Phase",
    "Previous",
    "Process",
    "ProcessRule",
    "ProximitySensor",
    "RadiationSensor",
    "Radio",
    "RealRobot",
    "Recording",
    "RobotDesign",
    "ScalarField",
    "Scale",
    "Seed",
    "Sensor",
    "Shape",
    "Shown",
    "Slider",
    "Stage",
    "Streams",
    "SwarmModel",
    "Wander",
    "all_round",
    "batch_run",
    "bump_sensor",
    "calibrate",
    "compare",
    "compiled_stage",
    "count",
    "disc",
    "draw_number",
    "drive",
    "event_count",
    "event_total",
    "held",
    "laser_sensor",
    "mean",
    "measure",
    "model_info",
    "omni_speeds",
    "polygon",
    "process",
    "rectangle",
    "scatter",
    "sensitivity",
    "share",
    "show",
    "sweep",
    "until",
    "until_zero",
    "value",
    "warm_up",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)

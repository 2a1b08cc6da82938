"""Learners: networks, policies, and how they are trained."""

from mesa_swarm.learning.actions import boltzmann, chosen, temperature_at
from mesa_swarm.learning.c_machines import export_machine
from mesa_swarm.learning.c_source import export_c
from mesa_swarm.learning.dynamic_programming import ApproachValues, approach_values
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.learning.fire_learning import LearnFires, SkillPolicy
from mesa_swarm.learning.fire_wheels import FireWheelPolicy, LearnFireWheels
from mesa_swarm.learning.fitness import Fitness, floreano
from mesa_swarm.learning.hebbian import HebbianLearning
from mesa_swarm.learning.networks import Networks, fit, fit_in_turn
from mesa_swarm.learning.onnx_files import export_onnx
from mesa_swarm.learning.policy import Policy, PolicyLayer, SensorLayout
from mesa_swarm.learning.policy_files import load_policy, save_policy
from mesa_swarm.learning.q_learning import QLearning, QPolicy
from mesa_swarm.learning.reflex_policy import ReflexPolicy
from mesa_swarm.learning.reward_lab import wall_readings
from mesa_swarm.learning.rewards import reward
from mesa_swarm.learning.table_learning import TablePolicy, TableQLearning
from mesa_swarm.learning.wire_learning import WireFittedQ, WirePolicy, wire_value

__all__ = [
    "ApproachValues",
    "Evolution",
    "FireWheelPolicy",
    "Fitness",
    "HebbianLearning",
    "LearnFireWheels",
    "LearnFires",
    "Networks",
    "Policy",
    "PolicyLayer",
    "QLearning",
    "QPolicy",
    "ReflexPolicy",
    "SensorLayout",
    "SkillPolicy",
    "TablePolicy",
    "TableQLearning",
    "WireFittedQ",
    "WirePolicy",
    "approach_values",
    "boltzmann",
    "chosen",
    "export_c",
    "export_machine",
    "export_onnx",
    "fit",
    "fit_in_turn",
    "floreano",
    "load_policy",
    "reward",
    "save_policy",
    "temperature_at",
    "wall_readings",
    "wire_value",
]

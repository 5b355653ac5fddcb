"""What a model lacks: an engine that knows no physics, and the actuator as a problem for it."""

from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.discover import discover
from torsight.discovery.interface import Candidate, OptionalMembers, Problem
from torsight.discovery.linear_problem import LinearProblem, linear_problem
from torsight.discovery.own.answer.findings import Findings
from torsight.discovery.own.find import find_missing
from torsight.discovery.own.model.declare import candidate, law, parameter
from torsight.discovery.own.model.layout import Reading
from torsight.discovery.own.model.ode import Event, Solver, ode
from torsight.discovery.own.model.problem import ModelProblem, model_problem
from torsight.discovery.prediction import PredictedAngle, predict_angle, predict_with_sigma
from torsight.discovery.report import DiscoveryReport
from torsight.discovery.settings import Settings
from torsight.discovery.together import JointReport, discover_together

__all__ = [
    "ActuatorProblem",
    "Candidate",
    "DiscoveryReport",
    "Event",
    "Findings",
    "JointReport",
    "LinearProblem",
    "ModelProblem",
    "OptionalMembers",
    "PredictedAngle",
    "Problem",
    "Reading",
    "Settings",
    "Solver",
    "candidate",
    "discover",
    "discover_together",
    "find_missing",
    "law",
    "linear_problem",
    "model_problem",
    "ode",
    "parameter",
    "predict_angle",
    "predict_with_sigma",
]

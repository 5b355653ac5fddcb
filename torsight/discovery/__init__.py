"""What a model lacks: an engine that knows no physics, and the actuator as a problem for it."""

from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.discover import discover
from torsight.discovery.engine import Findings, find_missing
from torsight.discovery.interface import Candidate, Problem
from torsight.discovery.linear_problem import LinearProblem, linear_problem
from torsight.discovery.prediction import PredictedAngle, predict_angle, predict_with_sigma
from torsight.discovery.report import DiscoveryReport
from torsight.discovery.settings import Settings
from torsight.discovery.together import JointReport, discover_together

__all__ = [
    "ActuatorProblem",
    "Candidate",
    "DiscoveryReport",
    "Findings",
    "JointReport",
    "LinearProblem",
    "PredictedAngle",
    "Problem",
    "Settings",
    "discover",
    "discover_together",
    "find_missing",
    "linear_problem",
    "predict_angle",
    "predict_with_sigma",
]

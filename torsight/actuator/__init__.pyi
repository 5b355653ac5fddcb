# The names of torsight.actuator for editors and type checkers; they are imported on first use.

from torsight.actuator.characterising.characterisation import characterise as characterise
from torsight.actuator.characterising.spring_tests import read_tests as read_tests
from torsight.actuator.drive import Drive as Drive
from torsight.actuator.effects import Effect as Effect
from torsight.actuator.effects import load_effects as load_effects
from torsight.actuator.fit_result import FitResult as FitResult
from torsight.actuator.fitted import FittedModel as FittedModel
from torsight.actuator.fitted import fitted_model as fitted_model
from torsight.actuator.fitted import read_model as read_model
from torsight.actuator.fitted import write_model as write_model
from torsight.actuator.model import ActuatorModel as ActuatorModel
from torsight.actuator.record.logs import read_log as read_log
from torsight.actuator.simulation import Prediction as Prediction
from torsight.actuator.simulation import Simulation as Simulation
from torsight.actuator.spec import ActuatorSpec as ActuatorSpec
from torsight.actuator.spec import read_actuator as read_actuator
from torsight.actuator.spec import reference_spec as reference_spec
from torsight.actuator.springs import Rig as Rig
from torsight.actuator.stepping.cycle import half_cycle as half_cycle
from torsight.actuator.stepping.cycle import stable_cycle as stable_cycle

# The fit is made by the discovery, above this room: the name alone is here, nothing in this room uses it.
from torsight.discovery.model_fit import fit_model as fit_model

from .run import run_case as run_case
from .simulate import Simulation as Simulation

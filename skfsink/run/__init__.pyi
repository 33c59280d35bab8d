from .compute import run as run
from .compute import run_case as run_case
from .observers.observer import Observer as Observer
from .observers.view import View as View
from .simulate import Simulation as Simulation

from .dead_load import DeadLoad as DeadLoad
from .grips import Grip as Grip
from .grips import Ramp as Ramp
from .grips import Traction as Traction
from .pressure import Filling as Filling
from .pressure import Pressure as Pressure
from .schedule import Loading as Loading

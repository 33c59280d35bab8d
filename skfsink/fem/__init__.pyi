from .amg import AmgCG as AmgCG
from .direct import Factorization as Factorization
from .forms import DensityForms as DensityForms
from .forms import MomentumForms as MomentumForms
from .forms import density_forms as density_forms
from .forms import momentum_forms as momentum_forms
from .pattern import Pattern as Pattern
from .space import Space as Space

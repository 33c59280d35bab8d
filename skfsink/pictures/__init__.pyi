from .film import still as still
from .of_a_run import draw_comparison as draw_comparison
from .of_a_run import draw_run as draw_run
from .stress_curves import stress_picture as stress_picture

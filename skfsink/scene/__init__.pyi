from .controls import Controls as Controls
from .deck import Deck as Deck
from .deck import read_deck as read_deck
from .options import Options as Options
from .registry import CASES as CASES
from .registry import case_function as case_function
from .scene import Scene as Scene
from .stored import read_scene as read_scene

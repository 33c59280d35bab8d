"""What the paper prints: dissipated energies U [N mm/mm], numbers of elements, and sentences put as numbers."""

from __future__ import annotations

__all__ = ["ELEMENTS", "SHORT", "TABLE_1", "TITLES", "U"]

#: U by case and analysis: Table 1 (mesh M4), Sec. 5.2 and 5.3.
U = {("single_edge_notch", "dynamic"): 0.064,
     ("simple_shear", "dynamic"): 0.036, ("simple_shear", "quasistatic"): 0.023,
     ("symmetric_double_edge_notch", "dynamic"): 0.0295, ("symmetric_double_edge_notch", "quasistatic"): 0.0140}
#: Table 1: numbers of elements, U.
TABLE_1 = {"M3": (11140, 0.067), "M4": (18967, 0.064), "M5": (28784, 0.068)}
#: Numbers of elements in Sec. 5.1 to 5.6, where given.
ELEMENTS = {"single_edge_notch": 18967, "simple_shear": 50847, "asymmetric_double_edge_notch": 28531,
            "dog_bone": 82382, "cylindrical_shell": 53122}
TITLES = {"single_edge_notch": "single-edge notch", "simple_shear": "simple shear",
          "symmetric_double_edge_notch": "symmetric double-edge notch",
          "asymmetric_double_edge_notch": "asymmetric double-edge notch", "dog_bone": "dog-bone",
          "cylindrical_shell": "cylindrical shell"}
#: The same in two lines, for axes.
SHORT = {"single_edge_notch": "single\nedge", "simple_shear": "simple\nshear",
         "symmetric_double_edge_notch": "sym.\ndouble", "asymmetric_double_edge_notch": "asym.\ndouble",
         "dog_bone": "dog-\nbone", "cylindrical_shell": "shell"}

"""A notched plate: load it, let its crack run, look.

The single-edge notched plate of the paper (Sec. 5.1) on its coarse mesh, up to the moment at which the crack has run
for 1 mm. The number: the opening at the onset converges to 0.1249 mm as elements get smaller, and meshes with rings
of elements around the notch are within 0.3 % of it whatever their size (docs/convergence.md).
"""

import skfsink as sk

plate = sk.single_edge_notch(mesh="coarse", stop="crack_length > 1 mm", out="results/notched_plate", overwrite=True)
print(plate)
plate.plot("notched_plate.png")

onset = plate.summary["onset"]["displacement_mm"]
print(f"onset at {onset:.4f} mm; as elements get smaller: 0.1249 mm")
assert abs(onset / 0.1249 - 1) < 0.005

"""A strip with fibres, and which way it tears.

Adventitia with two families of fibres at 20 degrees to a direction that is inclined to the strip by 45 degrees, and
then by -45. The number: both strips are mirror images of each other, and so must be the ways of their tears: the sum
of the directions is 0. Rounding and single elements are allowed 5 degrees. Rows of equal elements steer a tear, so the
direction itself says less.
"""

import numpy as np

import skfsink as sk

mesh = sk.grid_mesh(np.linspace(0, 2, 41), np.linspace(0, 2, 42))
y = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)[:, 1]
mesh.cell_sets = {"ends": [np.flatnonzero(abs(y - 1) > 0.6)]}  # which do not fail, for the corners at the grips
sk.write_mesh("strip.vtu", mesh)


def tear(sign):
    """The run, and the direction from the tip of the cut to that of the tear [degrees]."""
    law = f"angle = 20, axis = 1 {sign} 0"
    run = sk.custom(mesh="strip.vtu", title="A strip with fibres", material="hgo", constants=law, event_time="200 us",
                    regions=[{"name": "ends", "material": "hgo", "constants": law, "phi": "10 MPa"}],
                    grips=[{"boundary": "top", "x": 0, "y": "1 um/s"}, {"boundary": "bottom", "x": 0, "y": "-1 um/s"}],
                    cracks=[{"name": "cut", "points": [[0, 1], [0.5, 1]], "lips": "whole"}],
                    stop="crack_length > 0.4 mm", out=f"results/fibres{sign}", overwrite=True)
    x, y = run.event["tip_x_mm"][-1], run.event["tip_y_mm"][-1]
    return run, np.degrees(np.arctan2(y - 1.0, x - 0.5))


(run, one), (_, other) = tear(1), tear(-1)
run.plot("fibre_strip.png")
print(f"the tears run at {one:.0f} and {other:.0f} degrees to the cut")
assert abs(one + other) < 5

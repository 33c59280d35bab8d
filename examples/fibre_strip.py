"""A strip with fibres, and which way it tears.

Adventitia with two families of fibres at 20 degrees to a direction that is inclined to the strip by 45 degrees, and
then by -45. The number: both strips are mirror images of each other, and so must be the ways of their tears: the sum
of the directions is 0. Rounding and single elements are allowed 5 degrees.
"""

import numpy as np

import skfsink as sk

sk.write_mesh("strip.vtu", sk.grid_mesh(np.linspace(0, 2, 41), np.linspace(0, 2, 42)[:]))


def tear(sign):
    """Direction of the tear, from the tip of the cut to the middle of what has failed [degrees]."""
    run = sk.custom(mesh="strip.vtu", title="A strip with fibres", material="hgo", event_time="100 us",
                    constants=f"angle = 20, axis = 1 {sign} 0", length_scale="0.1 mm", stop="crack_length > 0.4 mm",
                    grips=[{"boundary": "top", "x": 0, "y": "1 um/s"}, {"boundary": "bottom", "x": 0, "y": "-1 um/s"}],
                    cracks=[{"name": "cut", "points": [[0, 1], [0.5, 1]], "lips": "whole"}],
                    out=f"results/fibres{sign}", overwrite=True)
    x, y = run.event["tip_x_mm"][-1], run.event["tip_y_mm"][-1]
    return run, np.degrees(np.arctan2(y - 1.0, x - 0.5))


(run, one), (_, other) = tear(1), tear(-1)
run.plot("fibre_strip.png")
print(f"the tears run at {one:.0f} and {other:.0f} degrees to the cut")
assert abs(one + other) < 5

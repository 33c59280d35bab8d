"""A quantity of your own, and an end of your own.

A plate with a hole, pulled on four sides (docs/decks.md). An observer follows the stretch of the rim; the loading ends
when it is 1.15, before much softens. The number: an incompressible body in plane strain has no choice, r^2 = R^2 + c,
so the stretch of a circle of 1 mm follows from that of the rim of 0.5 mm. The plate is coarse, and the 400 shear moduli
of its bulk modulus let it grow a little: 3 % of what the circle is stretched by is allowed.
"""

import matplotlib.pyplot as plt
import numpy as np

import skfsink as sk


class Circles(sk.Observer):
    """Mean stretch of the nodes near two circles: the rim, and one of twice its radius."""

    kept = ("rows",)

    def __init__(self):
        self.rows = []

    def loading(self, view):
        X = view.body.space.X
        R, r = np.hypot(*X.T), np.hypot(*(X + view.state.u).T)
        near = [R < 0.501, abs(R - 1.0) < 0.05]
        self.rows.append([float((r[some] / R[some]).mean()) for some in near] + [float(R[near[1]].mean())])


circles = Circles()
out = [[i, 1e-3 * i] for i in range(21)]  # increments end at the points of a ramp
back = [[t, -u] for t, u in out]
sides = {"left": {"x": back}, "bottom": {"y": back}, "top": {"y": out}, "right": {"x": out}}
plate = sk.custom(mesh=sk.data_folder("biaxial_hole") / "meshes" / "coarse.vtu", title="A plate with a hole",
                  grips=[{"boundary": name, **motion} for name, motion in sides.items()], observers=[circles],
                  stop=lambda view: circles.rows[-1][0] > 1.15, out="results/circles", overwrite=True)
rim, circle, R = np.array(circles.rows).T
closed = np.sqrt(1 + (rim**2 - 1) * 0.25 / R**2)
figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
axes.plot(rim, closed, "k", label=r"$r^2=R^2+c$")
axes.plot(rim, circle, "o", color="tab:red", label="plate")
axes.set(xlabel="stretch of the rim", ylabel="stretch of a circle of 1 mm")
axes.legend()
figure.savefig("own_observable.png", dpi=120)
print(f"{circle[-1]:.4f}, closed form {closed[-1]:.4f}")
assert abs((circle[-1] - 1) / (closed[-1] - 1) - 1) < 0.03

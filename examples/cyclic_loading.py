"""Cycles of loading, and then a crack.

The plate of the paper is pulled to 88 % of its onset and back, three times, and then until its crack has grown by 0.5
mm. The number: a point fails by the greatest energy that it has seen, so cycles below that change nothing, and the
onset is at the opening of a plate that is pulled once: there is no fatigue in this theory. Both onsets are searched for
from other load increments, each to within 0.05 % of the load; 0.2 % is allowed.
"""

import matplotlib.pyplot as plt

import skfsink as sk

mesh = sk.data_folder("single_edge_notch") / "meshes" / "coarse.vtu"


def pulled(cycles, out):
    """The plate after so many cycles; each takes 2 s of load time, each grip moves by 0.055 mm."""
    way = [[0, 0], *([t, 0.055 * (t % 2)] for t in range(1, 2 * cycles + 1)), [2 * cycles + 2, 0.11]]
    return sk.custom(mesh=mesh, title="A plate after cycles", stop="crack_length > 0.5 mm", out=out, overwrite=True,
                     grips=[{"boundary": "top", "x": 0, "y": way},
                            {"boundary": "bottom", "x": 0, "y": [[t, -u] for t, u in way]}])


once, thrice = pulled(0, "results/once"), pulled(3, "results/thrice")
figure, (axes, crack) = plt.subplots(2, figsize=(5, 4.5), layout="constrained")
loading = thrice.history["phase"] == "loading"
axes.plot(thrice.history["time_s"][loading], thrice.history["reaction_N_per_mm"][loading], "k.-")
axes.set(xlabel="load time (s)", ylabel="load (N/mm)")
crack.plot(thrice.event["time_s"] * 1e6, thrice.event["crack_length_mm"], color="tab:red")
crack.set(xlabel="time since the onset (µs)", ylabel="crack (mm)")
figure.savefig("cyclic_loading.png", dpi=120)

one, other = (run.summary["onset"]["displacement_mm"] for run in (once, thrice))
print(f"onset at {one:.5f} mm, after three cycles at {other:.5f} mm")
assert abs(other / one - 1) < 2e-3

"""Cycles of loading, in which a crack grows.

A strip with a cut is pulled to and fro, each time farther, fast enough for inertia (the event begins at load time 0).
A point fails by the greatest energy it has seen, so there is no fatigue. The number: what the sink takes, D, never
falls, and while the grips go back it grows by less than 10 % of all: the crack grows where it is pulled farther than
before.
"""

import matplotlib.pyplot as plt
import numpy as np

import skfsink as sk

sk.write_mesh("strip.vtu", sk.grid_mesh(np.linspace(0, 3, 61), np.linspace(0, 1, 21)))
points = [[0, 0]]  # of each grip [s, mm]
for i, peak in enumerate([0.024, 0.028, 0.032]):
    points += [[(2 * i + 1) * 5e-5, peak], [(2 * i + 2) * 5e-5, 0]]
strip = sk.custom(mesh="strip.vtu", title="Cycles", event_at=0.0, event_time="300 us", out="results/cycles",
                  overwrite=True, grips=[{"boundary": "top", "y": points}, {"boundary": "right", "x": 0},
                         {"boundary": "bottom", "y": [[t, -u] for t, u in points]}],
                  cracks=[{"name": "cut", "points": [[0, 0.475], [1, 0.475]], "lips": "whole"}])
event = strip.event
t, D = event["time_s"] * 1e6, event["sink_stored"] + event["sink_kinetic"]
figure, (axes, low) = plt.subplots(2, sharex=True, figsize=(5, 4), layout="constrained")
axes.plot(t, event["grip_displacement_mm"], "k")
axes.set_ylabel("opening (mm)")
low.plot(t, event["crack_length_mm"], color="tab:red", label="crack (mm)")
low.plot(t, D / D[-1], color="tab:blue", label="D over its last value")
low.set_xlabel("time (µs)")
low.legend()
figure.savefig("cyclic_loading.png", dpi=120)
back = (np.floor(t / 50) % 2 == 1)[:-1]
share = np.diff(D)[back].sum() / D[-1]
print(f"crack of {event['crack_length_mm'][-1]:.2f} mm; {share:.1%} of D while the grips go back")
assert (np.diff(D) >= -1e-9).all() and share < 0.1

"""A sheet of rubber, stretched to three times its length.

Gent's law in plane stress, pulled at one end; sides slide, nothing fails. The number: the nominal stress of uniaxial
tension, mu J_m/(J_m - I_1 + 3) (s - 1/s^2), of an incompressible sheet. The volume grows by a third of the Cauchy
stress over the bulk modulus, 2.6/(3 500) = 0.17 %; 0.2 % is allowed.
"""

import matplotlib.pyplot as plt
import numpy as np

import skfsink as sk

sk.write_mesh("sheet.vtu", sk.grid_mesh(np.linspace(0, 2, 5), np.linspace(0, 1, 3)))
sheet = sk.custom(mesh="sheet.vtu", title="A rubber sheet", element="planestress", material="gent",
                  length_scale="2 mm", stop="displacement > 4 mm", out="results/sheet", overwrite=True, grips=[
                      {"boundary": "right", "x": "1 mm/s"}, {"boundary": "bottom", "y": 0},
                      {"boundary": "left", "x": 0}])

stretch, stress = 1 + sheet.history["grip_displacement_mm"] / 2, sheet.history["reaction_N_per_mm"]  # 1 mm wide
gent = sk.materials.gent()
s = np.linspace(1, stretch[-1], 200)
closed = gent.mu * gent.limit / (gent.limit - s**2 - 2 / s + 3) * (s - 1 / s**2)
figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
axes.plot(s, closed, "k", label="closed form")
axes.plot(stretch[9::20], stress[9::20], "o", color="tab:red", label="sheet")
axes.set(xlabel=r"stretch $\lambda$", ylabel="nominal stress (MPa)")
axes.legend()
figure.savefig("rubber_sheet.png", dpi=150)

print(f"{stress[-1]:.5f} MPa at a stretch of {stretch[-1]:.3f}, closed form {closed[-1]:.5f} MPa")
assert stretch[-1] > 3 and abs(stress[-1] / closed[-1] - 1) < 2e-3

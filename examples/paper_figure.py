"""Constants of your own, and a figure for a paper.

A tissue twice as stiff and twice as strong as that of the paper, with all else equal: its symmetric double-edge
notched plate, drawn as vector graphics without a title. The number: displacements depend on ratios of the constants
alone, so the onset is at the same opening as with the constants of the paper; the load is twice as large. The onset
is found to 0.05 %, its search ends at two different loads at the worst.
"""

import skfsink as sk

stiff = {"c1": "1234 kPa", "c2": "2430 kPa", "bulk_modulus": "1 GPa", "phi": "337.2 kPa"}
paper = sk.symmetric_double_edge_notch(mesh="mirror", model="onset", out="results/paper", overwrite=True)
tissue = sk.symmetric_double_edge_notch(mesh="mirror", **stiff, event_time="25 us", frame_every="5 us",
                                        out="results/tissue", overwrite=True)
sk.picture(tissue, "paper_figure.pdf", title="")
sk.picture(tissue, "paper_figure.png", title="")

onset, twice = paper.summary["onset"], tissue.summary["onset"]
print(f"load at the onset: {onset['reaction_N_per_mm']:.4f} and {twice['reaction_N_per_mm']:.4f} N/mm")
assert abs(twice["displacement_mm"] / onset["displacement_mm"] - 1) < 1e-3
assert abs(twice["reaction_N_per_mm"] / onset["reaction_N_per_mm"] - 2) < 2e-3

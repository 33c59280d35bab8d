"""An ensemble of meshes on Dask.

The same plate on three meshes that differ by their seed, with rings of elements around the notch, as a sweep whose runs go
to the workers of a cluster of Dask (the extra sweep); this one is on the machine. The number: the opening at the onset of
meshes with resolved notches scatters by less than 0.1 % (docs/convergence.md); on these smaller ones 0.5 % is allowed.
"""

from pathlib import Path

import numpy as np

import skfsink as sk

try:
    from distributed import LocalCluster
except ImportError:
    raise SystemExit("this example needs Dask: pip install 'skfsink[sweep]'") from None

if __name__ == "__main__":
    Path("plate.toml").write_text("""
case = "single_edge_notch"

[parameters]
side = 2.0
notch = 0.5
model = "onset"
""")
    meshes = ",".join(str(sk.data_folder("study") / "meshes" / f"tip{i}.vtu") for i in range(3))
    with LocalCluster(n_workers=1, threads_per_worker=1) as cluster:
        rows = sk.run_sweep(Path("plate.toml"), [f"mesh={meshes}"], Path("results/ensemble"),
                            scheduler=cluster.scheduler_address, quiet=True)
    print(rows)

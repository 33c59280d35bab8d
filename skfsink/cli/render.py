"""`render`: a picture or a film of any field."""

from __future__ import annotations

from pathlib import Path

__all__ = ["render"]


def render(folder: Path, *, film: bool = False, moment: str = "end", field: str = "gamma", width: int = 900,
           phase: str = "event", azimuth: float | None = None, elevation: float | None = None,
           out: Path | None = None) -> None:
    """Draw the body of a run, deformed and cut open along the crack, in colours of a field, still or moving.

    Bodies in space need the extra `view`, which also makes films as MP4.

    Parameters
    ----------
    folder
        Of a run of one analysis, finished or not.
    film
        A film of all frames instead of one picture.
    moment
        Of a picture: "onset", "branching", "arrival", "end", or the number of a frame.
    field
        "gamma", "speed" of the material, "von_mises", "principal_stress", "pressure", "stretch" or "W"; stretches are
        in frames of runs with `--fields stretch`.
    width
        Of the picture [pixels], in [100, 4000].
    phase
        Of a film: "event", "loading" or "all".
    azimuth
        Of the observer of a body in space [degrees]; default that of the case.
    elevation
        Of the observer [degrees], in [-89, 89]; default that of the case.
    out
        File to write; default FIELD-MOMENT.png or FIELD.gif in the folder of the run. A picture may also be .pdf or
        .svg (of a plane body), a film .mp4.
    """
    from ..errors import require
    from ..pictures.film import film as make_film
    from ..pictures.film import still
    from ..results.loader import load

    require("width", width, "pixels", low=100, high=4000, whole=True)
    run = load(folder)
    view = run.scene.view if azimuth is None and elevation is None else (
        require("azimuth", run.scene.view[0] if azimuth is None else azimuth, "degrees", low=-360, high=360),
        require("elevation", run.scene.view[1] if elevation is None else elevation, "degrees", low=-89, high=89))
    path = out or folder / (f"{field}.gif" if film else f"{field}-{moment}.png")
    if film:
        make_film(run, path, field, width, view=view, phase=phase)
    else:
        still(run, path, moment, field, width, view)
    print(path)


if __name__ == "__main__":
    from .program import command

    command(render, package="commands")

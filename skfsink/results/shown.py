"""How a run shows itself: in a line, as text with its key figures, in a notebook, as a picture, as data frames."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from PIL import Image

from ..errors import OutputError
from ..system.files import path_of, reported, write_atomic
from .data_frames import frame_of_run
from .tables import Table, key_table

if TYPE_CHECKING:
    from .loader import Run

__all__ = ["Shown"]

_ANALYSES = {"dynamic": "dynamic", "quasistatic": "quasi-static", "both": "dynamic and quasi-static"}
_WIDTH = 900  # of the picture in a notebook [pixels]


class Shown:
    """What :class:`.Run` and :class:`.Result` show of themselves.

    Attributes
    ----------
    PICTURES: files of the main picture, in the folder of the run: the first one that is there.
    """

    PICTURES: ClassVar[tuple[str, ...]] = ("comparison.png", "density.png")

    if TYPE_CHECKING:  # as a run has them
        folder: Path
        case: str
        parameters: Mapping[str, Any]
        parts: Mapping[str, Run]
        analysis: property
        runs: property
        warnings: property

    @property
    def title(self) -> str:
        """The case, or the title of a scene of your own."""
        return str(self.parameters.get("title") or self.case.replace("_", " "))

    def table(self) -> Table:
        """The key figures with their units; of `analysis="both"` a column for each analysis.

        `print` shows it as text, a notebook as a table, and `rows` has it by name, unit and cells.
        """
        labels = [_ANALYSES[run.analysis] for run in self.runs]
        return key_table(self.runs, labels, [None] * len(labels))

    def to_pandas(self, what: str = "history") -> Any:
        """A `pandas.DataFrame` of the run; the names of its columns end with their units, as in the files.

        Parameters
        ----------
        what: "history" (a row a record), "event" (of these, the event), "tips" (position, length and speed of the
            crack in the event), "deletions" (failed elements), "fragments" (pieces), "release" (energy release rates
            of the tips, where an observer :class:`.EnergyRelease` looked), or the name of a probe.

        Returns
        -------
        `attrs["units"]` of a history or a probe has the units by column. Of `analysis="both"` a column `analysis`
        comes first.

        Raises
        ------
        ParameterError
            There is nothing of that name.
        MissingExtra
            There is no pandas.
        """
        return frame_of_run(self, what)  # type: ignore[arg-type]

    def plot(self, path: str | Path) -> Path:
        """Write the main picture to a file: γ on the deformed body at the key moments, of `analysis="both"` both
        analyses beside each other with their energies. The other pictures are in the folder of the run.

        Parameters
        ----------
        path: of the file; ".png", or another format of images (".jpg", ".tif", ".webp"). Vector graphics are drawn
            by :func:`skfsink.picture`.

        Returns
        -------
        The path.

        Raises
        ------
        OutputError
            The run has left no picture, or the format is none of an image.
        """
        path = path_of("path", path)
        suffix, source = path.suffix.lower(), self._picture()
        if source is None:
            raise OutputError(f"there is no picture in {self.folder}: it has neither {' nor '.join(self.PICTURES)}")
        with reported(f"cannot read {source}"):
            content = source.read_bytes()
        if suffix != ".png":
            kind = Image.registered_extensions().get(suffix)
            if kind not in ("JPEG", "TIFF", "WEBP"):
                raise OutputError(f"plot writes .png, .jpg, .tif and .webp; got {path.name}: skfsink.picture(run, "
                                  f"path) draws .pdf and .svg")
            file = io.BytesIO()
            Image.open(source).convert("RGB").save(file, kind, dpi=(300, 300))
            content = file.getvalue()
        write_atomic(path, content)
        return path

    def _picture(self) -> Path | None:
        return next((path for name in self.PICTURES if (path := self.folder / name).is_file()), None)

    def _state(self) -> list[str]:
        """What became of it, a line for each analysis."""
        return [(f"{_ANALYSES[run.analysis]}: " if self.parts else "")
                + (run.verdict if run.finished else "not finished") for run in self.runs]

    def __repr__(self) -> str:
        return (f"<{type(self).__name__} of {self.case}, {_ANALYSES[self.analysis]}, in {self.folder}: "
                f"{'; '.join(self._state())}>")

    def __str__(self) -> str:
        lines = [f"{self.title}, {_ANALYSES[self.analysis]}, in {self.folder}", *self._state()]
        if any(run.finished for run in self.runs):
            lines += ["", str(self.table())]
        return "\n".join([*lines, *(f"warning: {text}" for text in dict.fromkeys(self.warnings))])

    def _repr_html_(self) -> str:
        """For a notebook: what became of it, the key figures, the main picture and the warnings."""
        parts = [f"<p><b>{html.escape(self.title)}</b>, {_ANALYSES[self.analysis]}, in "
                 f"<code>{html.escape(str(self.folder))}</code></p>",
                 *(f"<p>{html.escape(line)}</p>" for line in self._state())]
        if any(run.finished for run in self.runs):
            parts.append(self.table()._repr_html_())
        if (source := self._picture()) is not None:
            file = io.BytesIO()
            with reported(f"cannot read {source}"), Image.open(source) as image:
                small = image.convert("RGB")
            small.thumbnail((_WIDTH, _WIDTH))
            small.save(file, "PNG", optimize=True)
            data = base64.b64encode(file.getvalue()).decode()
            parts.append(f'<img alt="{html.escape(self.title)}" src="data:image/png;base64,{data}">')
        if self.warnings:
            items = "".join(f"<li>{html.escape(text)}</li>" for text in dict.fromkeys(self.warnings))
            parts.append(f"<p>Warnings:</p><ul>{items}</ul>")
        return "<div>" + "".join(parts) + "</div>"

"""skfsink from Python: its names, case functions with keywords, materials, and results that show themselves."""

from __future__ import annotations

import base64
import io
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import skfsink as sk
from skfsink.errors import MeshError, MissingExtra, OutputError, ParameterError
from skfsink.material import MATERIALS, limiter_of, material_from
from skfsink.results.history import history_header
from skfsink.results.tables import Row, Table
from skfsink.scene.registry import CASES, find_case

ROOT = Path(__file__).resolve().parents[1]


# --- names ---
def test_every_name_is_there() -> None:
    """Fails if a name of the package stands for nothing, or a case has none."""
    for name in sk.__all__:
        assert getattr(sk, name) is not None
    assert {*CASES} <= {*sk.__all__}


def test_names_in_documents_and_examples() -> None:
    """Fails if a page or an example uses a name of `skfsink` as `sk` that is not there."""
    patterns = ("*.md", "docs/**/*.md", "docs/*.ipynb", "examples/*.py")
    texts = {path: path.read_text(encoding="utf-8") for pattern in patterns for path in ROOT.glob(pattern)}
    used = {(path.name, name) for path, text in texts.items() for name in re.findall(r"\bsk\.([A-Za-z_]\w*)", text)}
    assert len(used) > 40
    assert [(page, name) for page, name in sorted(used) if name not in sk.__all__] == []


# --- case functions ---
def test_options_are_keywords(mesh: Path) -> None:
    """Fails if a keyword does not go where `Options` has it, loses its unit, or the signature of a case changes."""
    one = sk.single_edge_notch.scene(mesh=str(mesh), phi="200 kPa", length_scale=0.6, density="1.2 g/cm^3", side="4 mm")
    two = find_case("single_edge_notch").scene(
        {**find_case("single_edge_notch").default_arguments, "mesh": str(mesh)},
        sk.Options(phi=0.2, length_scale=0.6, density=1200.0))
    assert one.fingerprint == two.fingerprint
    both = sk.single_edge_notch.scene(mesh=str(mesh), phi=0.2, options=sk.Options(phi=0.1, length_scale=0.6))
    assert both.sink_law == sk.SinkLaw(phi=0.2, length_scale=0.6)
    assert "options" in find_case("single_edge_notch").function.__wrapped__.__kwdefaults__


@pytest.mark.parametrize("keywords, words", [
    ({"msh": "coarse"}, r"has no parameter 'msh'; `skfsink show single_edge_notch` lists them"),
    ({"phi": "2 mm"}, "phi must be a quantity in MPa"), ({"side": "2 s"}, "side must be a quantity in mm"),
    ({"phi": -1}, "phi must be a finite number"), ({"options": {}, "phi": 1}, "give each as a keyword"),
    ({"options": {}}, "options must be skfsink.Options"), ({"analysis": "static"}, "analysis must be one of")])
def test_wrong_keywords_are_refused(keywords: dict[str, Any], words: str) -> None:
    """Fails if a keyword that means nothing is swallowed, or its error does not say what there is."""
    with pytest.raises(ParameterError, match=words):
        sk.single_edge_notch(**keywords)


# --- materials ---
def test_materials_by_name() -> None:
    """Fails if a law of the library is not there, or its constants are read in another way than those of a deck."""
    for name in MATERIALS:
        assert getattr(sk.materials, name.replace("-", "_"))() == material_from(name)
        assert name.replace("-", "_") in dir(sk.materials) and sk.materials.limiter(name).phi == limiter_of(name).phi
    assert sk.materials.gent(mu="300 kPa", limit=80, density="1 g/cm^3") == material_from(
        "gent", {"mu": 0.3, "limit": 80.0, "density": 1000.0})
    assert sk.materials.hgo(axis=(0, 1, 0), angle="0.5 rad").angle == pytest.approx(np.degrees(0.5))
    assert sk.materials.neo_hookean(E=3.0, nu=0.4999).mu == pytest.approx(1.0, rel=1e-3)
    assert "gent(mu=0.27, limit=76.5); phi 15.62" in repr(sk.materials)
    with pytest.raises(AttributeError, match="materials has no gnt; it has aaa, "):
        sk.materials.gnt()
    for constants, words in (({"mu": "1 mm"}, "must be a quantity in MPa"), ({"my": 1}, "must be name = value pairs"),
                             ({"nu": 0.4, "bulk_modulus": 3}, "bulk_modulus and nu say the same")):
        with pytest.raises(ParameterError, match=words):
            sk.materials.neo_hookean(**constants)


def test_a_material_draws_itself() -> None:
    """Fails if a curve is not the stress of its path, the peak not the strength, or given axes are not drawn on."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    law = sk.materials.neo_hookean(mu=2.0)
    stretch, stress = law.plot(path="uniaxial tension").lines[0].get_data()
    assert stretch[-1] == 2.0 and stress == pytest.approx(2.0 * (stretch**2 - 1 / stretch), rel=1e-12)
    amount, shear = law.plot(path="simple shear").lines[0].get_data()
    assert shear == pytest.approx(2.0 * amount)
    ax = pyplot.figure().subplots()
    sink = sk.SinkLaw(phi=0.4)
    assert law.plot(sink, ax=ax) is ax and len(ax.get_legend().texts) == 3
    tops = [line.get_ydata()[0] for line in ax.lines if len(line.get_xdata()) == 1]
    assert tops == pytest.approx([peak.stress for name, peak in sk.peaks(law, sink).items() if name != "simple shear"])
    with pytest.raises(ParameterError, match="path must be one of uniaxial tension"):
        law.plot(path="tension")
    pyplot.close("all")


def test_grids() -> None:
    """Fails if the cells of a grid do not fill it, are turned over, or lines that do not ascend are taken."""
    for lines in (([0, 1, 3], [0, 2]), ([0, 1, 3], [0, 2], [1, 2, 2.5])):
        mesh = sk.grid_mesh(*lines)
        (cells,) = mesh.cells
        corners = mesh.points[cells.data]
        sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0],
                          corners[:, 4] - corners[:, 0] if len(lines) == 3 else np.tile([0, 0, 1.0], (2, 1))], axis=1)
        assert np.linalg.det(sides).sum() == pytest.approx(np.prod([line[-1] - line[0] for line in lines]))
        assert (np.linalg.det(sides) > 0).all()
        assert (corners[:, 0] + corners[:, 2] == corners[:, 1] + corners[:, 3]).all()  # in the order around
    assert sk.grid_mesh([0, 1], [0, 1], place=lambda X: 2 * X).points.max() == 2
    with pytest.raises(MeshError, match="two ascending coordinates y"):
        sk.grid_mesh([0, 1], [0, 0])


# --- results ---
@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> sk.Result:
    """Both analyses of the small plate, with one warning at least."""
    from plates import plate as mesh

    folder = tmp_path_factory.mktemp("plate")
    sk.write_mesh(folder / "plate.vtu", mesh())
    return sk.single_edge_notch(mesh=str(folder / "plate.vtu"), out=folder / "<run>", analysis="both", length_scale=0.6,
                                stop="crack_length > 0.7 mm", quiet=True)


def with_picture(run: sk.Run, name: str) -> bytes:
    """The content of a picture that is put into the folder of a run."""
    file = io.BytesIO()
    Image.new("RGB", (1800, 600), "white").save(file, "PNG")
    (run.folder / name).write_bytes(file.getvalue())
    return file.getvalue()


def test_a_result_is_a_run(plate: sk.Result) -> None:
    """Fails if what a folder says of a run and what the result in memory says differ."""
    loaded = sk.load(plate.folder)
    assert plate.verdict == loaded.verdict and plate.warnings == loaded.warnings
    for name, part in plate.parts.items():
        other = loaded.parts[name]
        assert part.energies == other.energies and part.clock == other.clock
        assert str(part.table()) == str(other.table())
        assert np.array_equal(part.deletions.element, other.deletions.element)
    assert repr(loaded) == repr(plate).replace("<Result", "<Run") and "\n" not in repr(plate)


def test_both_analyses_stand_beside_each_other(plate: sk.Result) -> None:
    """Fails if U and D of the two analyses are not in one line each, with unit and the values of the summaries."""
    rows = {row.name: row for row in plate.table().rows}
    assert plate.table().columns == ("dynamic", "quasi-static")
    for name, key in (("U at the end", "U_paper_final"), ("D at the end", "D_sink_final")):
        values = [part.summary["energy"][key] for part in plate.parts.values()]
        assert rows[name].unit == "N mm/mm" and rows[name].cells == tuple(f"{value:.4g}" for value in values)
        (line,) = [line for line in str(plate).splitlines() if line.startswith(name)]
        assert line.split()[-2:] == list(rows[name].cells)
    assert str(plate).splitlines()[0].startswith("Single-edge notched plate, dynamic and quasi-static, in ")
    assert all(f"warning: {text}" in str(plate) for text in plate.warnings) and plate.warnings


def test_a_notebook_shows_figures_picture_and_warnings(plate: sk.Result) -> None:
    """Fails if text is not escaped, or figures, warnings, or the picture, made small, are not shown."""
    with_picture(plate, "comparison.png")
    shown = plate._repr_html_()
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    assert Image.open(io.BytesIO(base64.b64decode(data))).size == (900, 300)
    assert "&lt;run&gt;" in shown and "<run>" not in shown
    assert "<td>U at the end</td><td>N mm/mm</td>" in shown and shown.count("<li>") == len(set(plate.warnings))
    assert "src=" not in plate.parts["quasistatic"]._repr_html_()  # it was not drawn
    assert Table("", ("<a>",), (Row("b & c", "", ("1",)),))._repr_html_().count("&lt;a&gt;") == 1


def test_the_main_picture_is_written(plate: sk.Result, tmp_path: Path) -> None:
    """Fails if it is another picture or format, or a run without one, or a format that is none, is not refused."""
    content = with_picture(plate, "comparison.png")
    assert plate.plot(tmp_path / "a.png").read_bytes() == content
    assert Image.open(plate.plot(tmp_path / "a.jpg")).format == "JPEG"
    with pytest.raises(OutputError, match=r"plot writes .png, .jpg, .tif and .webp; got a.pdf"):
        plate.plot(tmp_path / "a.pdf")
    with pytest.raises(OutputError, match=r"there is no picture in .*quasistatic: it has neither comparison.png nor"):
        plate.parts["quasistatic"].plot(tmp_path / "b.png")


def test_pictures_are_drawn_again(plate: sk.Result, tmp_path: Path) -> None:
    """Fails if the picture of a folder cannot be drawn as vector graphics, or an unknown format is not refused."""
    assert "<svg" in sk.picture(plate, tmp_path / "both.svg").read_text()[:400]
    assert b"%PDF" in sk.picture(plate.parts["dynamic"].folder, tmp_path / "one.pdf", title="").read_bytes()[:8]
    with pytest.raises(OutputError, match=r"a picture is drawn as .pdf, .svg, .png; got one.gif"):
        sk.picture(plate, tmp_path / "one.gif")


def test_data_frames(plate: sk.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a column is not that of the file with its unit, or a missing pandas is a traceback."""
    pytest.importorskip("pandas")
    part = plate.parts["dynamic"]
    frame = part.to_pandas()
    header = (part.folder / "history.csv").read_text().splitlines()[0].split(",")
    assert list(frame.columns) == header and {*header} <= {*history_header(2)}
    assert frame.attrs["units"]["elastic_N_mm_per_mm"] == "N mm/mm"
    assert (frame["elastic_N_mm_per_mm"].to_numpy() == part.history["elastic"]).all()
    both = plate.to_pandas("deletions")
    assert list(both.columns) == ["analysis", "time_s", "element", "pass"]
    assert both["analysis"].value_counts().to_dict() == {
        name: len(run.deletions.element) for name, run in plate.parts.items()}
    assert len(part.to_pandas("tips")) == len(part.event["step"]) and "tip_x_mm" in part.to_pandas("tips")
    with pytest.raises(ParameterError, match="must be one of history, event, tips, deletions"):
        part.to_pandas("tip")


def test_without_pandas(plate: sk.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a missing pandas is a traceback and no line with its cure."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    for run in (plate, plate.parts["dynamic"]):
        with pytest.raises(MissingExtra, match=r"^to_pandas needs pandas: pip install pandas$"):
            run.to_pandas()

"""What people do with results: the loader, and the report as a real browser shows it."""

from __future__ import annotations

import ast
import json
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from pages import Page
from plates import SMALL, drawing, invoke, plate

import skfsink
from skfsink.cli.program import command
from skfsink.cli.report import report
from skfsink.errors import OutputError
from skfsink.fields.energy import OPTIONAL_TERMS
from skfsink.fields.frame_fields import ON_REQUEST
from skfsink.meshing.vtu import write_mesh
from skfsink.pictures import plot
from skfsink.report import charts, citation, report_page, write_report
from skfsink.report.scenes import command_line, run_labels
from skfsink.results import reference
from skfsink.results.history import HISTORY_COLUMNS, OF_PRESSURES, History
from skfsink.results.loader import ENERGIES, FIELD_UNITS
from skfsink.results.tables import energy_tables
from skfsink.system import shipped
from skfsink.system.shipped import data_folder

PACKAGE = Path(skfsink.__file__).parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small plate, dynamic and quasi-static. Tests do not change it."""
    root = tmp_path_factory.mktemp("report")
    write_mesh(root / "plate.vtu", plate())
    with drawing(True):
        status, err, _ = invoke("--mesh", root / "plate.vtu", "--out", root / "both", "--analysis", "both",
                                "--frame-every", "2e-5", *SMALL)
    assert (status, err) == (0, "")
    return root / "both"


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    """A copy of the dynamic run, to be damaged."""
    return Path(shutil.copytree(folder / "dynamic", tmp_path / "run"))


# --- the loader ---
def test_loaded_results_are_those_in_the_files(folder: Path) -> None:
    """Fails if a figure of the loader is not that of the summary, the history or the log of deletions."""
    both = skfsink.load(folder)
    assert both.analysis == "both" and list(both.parts) == ["dynamic", "quasistatic"] and both.finished
    for run in both.runs:
        assert run.summary == json.loads((run.folder / "summary.json").read_text())
        assert run.history.keys() == History.load(run.folder / "history.csv").keys()
        assert run.history.units["elastic"] == "N mm/mm" and run.history.dim == 2
        assert (run.event["phase"] == "event").all()
        assert len(run.deletions.element) == run.summary["deleted_elements"] == len(set(run.deletions.element))
        assert (np.diff(run.deletions.time) >= 0).all()
        clock, last = ("s", run.event["time_s"][-1]) if run.analysis == "dynamic" else ("pass", run.event["step"][-1])
        assert run.clock == clock and 0 < run.deletions.time[-1] <= last == run.frames.times[-1]
        log = (run.folder / "deletions.csv").read_text()
        assert log.splitlines()[0] == ("time_s,element" if clock == "s" else "pass,element")
        assert run.summary["units"] == {"load": "N/mm", "energy": "N mm/mm"}
        crushed = run.frames.frame("end").cell_data["crushed"][0]
        np.testing.assert_array_equal(crushed == 1, np.isnan(run.frames.frame("end").cell_data["von_mises"][0]))
        energy, energies = run.summary["energy"], run.energies
        assert list(energies) == [name for name, _, _ in ENERGIES if name not in (*OPTIONAL_TERMS, *OF_PRESSURES)]
        assert energies["U"].arrival == energy["U_paper_at_arrival"] and energies["U"].end == energy["U_paper_final"]
        assert energies["D"].arrival == pytest.approx(energy["D_sink_at_arrival"], rel=1e-14)
        spent = sum(energies[name].end for name in ("elastic", "kinetic", "D", "deletion", "numerical", "released"))
        assert spent == pytest.approx(energy["initial"] + energies["work"].end, rel=1e-3)  # the ledger
    assert run.scene.material.shear_wave_speed == pytest.approx(29.34, abs=0.01)
    with pytest.raises(OutputError, match=r"holds two runs: take one of its parts, dynamic or quasistatic$"):
        both.history  # noqa: B018


def test_frames_by_number_and_moment_plain_and_deformed(folder: Path) -> None:
    """Fails if a moment is another frame, the deformed body is not X + u, or a field has no unit."""
    frames = skfsink.load(folder / "dynamic").frames
    assert len(frames) == len(list((folder / "dynamic" / "series").glob("run_*.vtu"))) and frames.times[0] == 0
    plain, deformed = frames.frame("end"), frames.frame(-1, deformed=True)
    np.testing.assert_allclose(deformed.points - plain.points, plain.point_data["displacement"], atol=1e-7)
    assert np.ptp(deformed.points - plain.points) > 0.05
    assert {*plain.point_data, *plain.cell_data} == {*FIELD_UNITS} - {"region", "fibre_1", "fibre_2", *ON_REQUEST}
    assert plain.cell_data["stress"][0].shape[1] == 6
    assert len(list(frames)) == len(frames) and len(frames[1:3]) == 2
    with pytest.raises(IndexError):
        frames[len(frames)]
    with pytest.raises(OutputError, match=r"has no frame 'nothing'; it has onset, .*end$"):
        frames["nothing"]


def test_paraview_s_library_warps_a_frame_and_reads_the_stress(folder: Path) -> None:
    """Fails if the fields that ParaView needs for the deformed body, its stress and its energy are not there."""
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(folder / "dynamic" / "series" / "run.pvd")
    run = skfsink.load(folder / "dynamic")
    assert list(reader.time_values) == list(run.frames.times)
    reader.set_active_time_value(reader.time_values[0])
    body = reader.read()[0]
    warped = body.warp_by_vector("displacement")
    np.testing.assert_allclose(warped.points, run.frames.frame(0, deformed=True).points, atol=1e-6)
    height = np.ptp(warped.points[:, 1]) - np.ptp(body.points[:, 1])
    assert height == pytest.approx(1.005 * run.summary["onset"]["displacement_mm"], rel=1e-4)  # with the overshoot
    assert body["stress"].shape == (body.n_cells, 6)
    volume = body.compute_cell_sizes()["Area"]
    # in equilibrium the mean of P_yy over the body is the work of the load: V <P_yy> = F * side; sigma is near P here
    mean = volume @ body["stress"][:, 1] / 4.0
    assert mean == pytest.approx(run.summary["onset"]["reaction_N_per_mm"], rel=0.1)
    assert body["W"].min() >= 0 and volume @ (body["gamma_element"] * body["W"]) == pytest.approx(
        run.summary["energy"]["initial"], rel=0.01)


def test_stored_references_load_with_the_units_of_their_dimension() -> None:
    """Fails if files that were written before columns had units are not read any more."""
    plane = skfsink.load(data_folder("single_edge_notch") / "reference" / "M3-dynamic")
    solid = skfsink.load(data_folder("dog_bone") / "reference" / "paper-dynamic")
    assert (plane.history.units["reaction_N_per_mm"], solid.history.units["reaction_N_per_mm"]) == ("N/mm", "N")
    assert solid.energies["U"].end > 0 and solid.assumed


def test_unfinished_and_damaged_runs(copy: Path) -> None:
    """Fails if a run cannot be looked at while it goes on, or damage is not one line that names the file."""
    (copy / "summary.json").unlink()
    run = skfsink.load(copy)
    assert not run.finished and len(run.history["step"]) > 10 and len(run.frames) > 3 and run.warnings == []
    assert "<strong>This run is not finished.</strong>" in report_page([run])
    (copy / "history.csv").write_text("".join((copy / "history.csv").read_text().splitlines(True)[:3]))
    with pytest.raises(OutputError, match=r"has not come to its event yet: there is nothing to report$"):
        report_page([skfsink.load(copy)])
    (copy / "deletions.csv").write_text("time_s,element\n3.0,7\n")  # as formerly of sweeps too
    assert (skfsink.load(copy).deletions.time, skfsink.load(copy).deletions.element) == (3.0, 7)
    for name, read in (("deletions.csv", "deletions"), ("history.csv", "history")):
        (copy / name).write_text("time_s,element\n1,2,3\n")
        with pytest.raises(OutputError, match=f"{name} is .*damaged$"):
            getattr(skfsink.load(copy), read)
    (copy / "series" / "run_0001.vtu").write_bytes(b"<VTKFile")
    with pytest.raises(OutputError, match=r"run_0001.vtu is missing or damaged$"):
        run.frames.frame(1)
    (copy / "series" / "run.pvd").write_text("<")
    with pytest.raises(OutputError, match=r"run.pvd is missing or damaged$"):
        skfsink.load(copy).frames  # noqa: B018
    (copy / "scene.toml").write_text("case = ")
    with pytest.raises(OutputError, match=r"scene.toml is not the scene of a run"):
        skfsink.load(copy)
    with pytest.raises(OutputError, match=r"^nowhere holds no run: there is no nowhere/scene.toml$"):
        skfsink.load("nowhere")


def test_nothing_is_pickled() -> None:
    """Fails if a module imports something that pickles, or reads arrays that could hold objects."""
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else \
                [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {name.split(".")[0] for name in names} & {
                "pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}, path
            if isinstance(node, ast.Call) and ast.unparse(node.func) in {"np.load", "numpy.load"}:
                keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
                assert keywords.get("allow_pickle") == "False", path
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert ast.unparse(node.value) == "False", path


# --- the page ---
def checked(text: str) -> Page:
    """The page, once it is known to be well-formed, to stand alone, and to say what its pictures and tables are."""
    page = Page(text)
    assert not page.all("script") and len(page.all("h1")) == 1 and page.all("html")[0]["lang"] == "en"
    for attributes in (a for _, a in page.tags):
        for name in ("src", "href"):
            assert (attributes.get(name) or "data:").startswith(("data:", "#"))
    assert "url(" not in text and "@import" not in text
    for image in page.all("img"):
        assert len(image["alt"] or "") > 20
    assert len(page.all("caption")) == len(page.all("table")) > 3 and all(th.get("scope") for th in page.all("th"))
    ids = Counter(a["id"] for _, a in page.tags if "id" in a)
    assert max(ids.values()) == 1
    assert {a["href"] for a in page.all("a")} <= {f"#{name}" for name in ids}
    return page


def test_the_page_of_one_run_has_everything_in_it(folder: Path) -> None:
    """Fails if a part of the report is missing, or the page is not the same when it is made again."""
    run = skfsink.load(folder / "dynamic")
    text = report_page([run])
    page = checked(text)
    assert text == report_page([skfsink.load(folder / "dynamic")])
    images = page.all("img")
    assert Counter(str(image["src"]).split(";")[0] for image in images) == {
        "data:image/png": 4, "data:image/gif": 1, "data:image/svg+xml": 3}
    speed = next(str(image["alt"]) for image in images if str(image["alt"]).startswith("Speed of the leading tip"))
    assert "shear wave speed c_s 29.3 m/s, Rayleigh wave speed c_R 28 m/s" in speed
    for expected in ("doi:10.1115/1.4055670", "Cost", "Versions and machine",
                     f"<td>{run.summary['versions']['numpy']}</td>",
                     f"<td>{run.summary['energy']['U_paper_at_arrival']:.4g}</td>", *run.assumed,
                     "Characteristic length l of damage [mm]", "--length-scale 0.6"):
        assert expected.replace("&", "&amp;") in text
    assert text.count('class="changed"') == 2 * len(re.findall(r"--[a-z]", command_line(run)))


def test_warnings_and_the_choice_of_a_model_are_on_the_page(copy: Path) -> None:
    """Fails if what a run warned of, or what its model was said to cost, is not shown, or is taken for markup."""
    summary = json.loads((copy / "summary.json").read_text())
    summary |= {"warnings": ["l/h < 1.2 <script>alert(1)</script>"], "model": {
        "model": "dynamics", "price_s": 12.25, "cheaper": {"model": "statics", "refused": "off by 66.0%"},
        "text": "model dynamics (statics, then dynamics)"}}
    (copy / "summary.json").write_text(json.dumps(summary))
    text = report_page([skfsink.load(copy)])
    checked(text)
    assert "l/h &lt; 1.2 &lt;script&gt;" in text and "12.25" in text and "model statics, refused off by 66.0%" in text


def test_runs_compared(folder: Path, copy: Path) -> None:
    """Fails if the runs are not told apart, or parameters in which they agree are listed."""
    text = report_page([skfsink.load(folder)])
    page = checked(text)
    assert "<th scope=\"col\">dynamic</th><th scope=\"col\">quasi-static</th>" in text
    differ = text[text.index("<caption>Parameters that differ"):].split("</table>")[0]
    assert re.findall(r'<th scope="row">(\w+)</th>', differ) == ["analysis"]
    assert sum("Dynamic" in str(i["alt"]) or "dynamic crack beside" in str(i["alt"]) for i in page.all("img")) == 1
    scene = (copy / "scene.toml").read_text()
    (copy / "scene.toml").write_text(scene.replace("courant = 0.8", "courant = 0.5"))
    runs = [skfsink.load(f) for f in (folder / "dynamic", copy)]
    assert run_labels(runs) == ["dynamic", "run"]
    assert run_labels([runs[0], runs[0]]) == [f"{runs[0].folder.absolute().as_posix().replace('/', '//', 1)} (1)",
                                             f"{runs[0].folder.absolute().as_posix().replace('/', '//', 1)} (2)"]
    differ = report_page(runs).split("<caption>Parameters that differ")[1].split("</table>")[0]
    assert re.findall(r'<th scope="row">(\w+)</th><td>([^<]*)</td><td>([^<]*)', differ) == [("courant", "0.8", "0.5")]


def test_curves_of_all_runs_are_whole(folder: Path, copy: Path) -> None:
    """Fails if a curve leaves its picture, as one that goes beyond the first run's if the axes were set too early."""
    history = History(copy / "history.csv", [
        {**row, "U_paper": 5 * row["U_paper"], "crack_length_mm": 2 * row["crack_length_mm"]}
        for values in zip(*History.load(copy / "history.csv").values())
        for row in [dict(zip(HISTORY_COLUMNS, values))]])
    figures = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(charts, "_svg", lambda figure: figures.append(figure) or b"")
        runs, labels = [skfsink.load(folder / "dynamic"), skfsink.load(copy)], ["a", "b"]
        assert charts.energy_chart(runs, labels) and charts.loading_chart(runs, labels)
        assert charts.speed_chart(runs, labels, [(29.0, 28.0), (29.0, 28.0)])
    assert len(history.rows) > 10 and len(figures) == 3
    for ax in (ax for figure in figures for ax in figure.axes):
        for line in ax.lines:
            x, y = line.get_data()
            if len(x) > 2:
                assert x.max() <= ax.get_xlim()[1] and np.nanmax(y) <= ax.get_ylim()[1], ax.get_ylabel()


@pytest.mark.parametrize("term", OPTIONAL_TERMS)
def test_terms_of_the_ledger_are_shown_where_the_run_has_them(folder: Path, copy: Path, term: str) -> None:
    """Fails if report, picture or stored reference show a term of the ledger by its value: here it is 0 in the run that
    has it. Seen to fail with a term of zeros left out by the loader, the picture, and the reference."""
    rows = [dict(zip(HISTORY_COLUMNS, values)) for values in zip(*History.load(copy / "history.csv").values())]
    History(copy / "history.csv", rows, without={*OPTIONAL_TERMS, *OF_PRESSURES} - {term})
    plain, run = skfsink.load(folder / "dynamic"), skfsink.load(copy)
    assert set(run.energies) - set(plain.energies) == {term} and run.energies[term].end == 0.0
    meaning = run.energies[term].meaning
    found = [{row.name: row.cells for row in energy_tables(of, "ab"[:len(of)])[0].rows}
             for of in ([run], [plain], [plain, run])]
    assert found[0][meaning] == ("0", "0", "0") and meaning not in found[1] and found[2][meaning] == ("–", "0")
    labels = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plot, "save", lambda figure, *_: labels.append(figure.axes[0].get_legend_handles_labels()[1]))
        for of in (plain, run):
            plot.ledger_picture(of.history, "")
    assert set(labels[1]) - set(labels[0]) == {plot.BANDS[term][0]}
    for of, there in ((plain, False), (run, True)):
        target = reference.store(of.folder, copy.parent / f"stored-{there}", ("end",))
        assert (f"{term}_N_mm_per_mm" in (target / "history.csv").read_text().splitlines()[0]) == there


def test_half_of_a_body_says_so(copy: Path) -> None:
    """Fails if figures of a part are shown without those of the whole."""
    summary = json.loads((copy / "summary.json").read_text())
    summary["whole"] = {"energy": 2.0, "load": 2.0, "displacement": 1.0}
    summary["quantities"]["U"] = 2 * summary["quantities"]["U"]
    (copy / "summary.json").write_text(json.dumps(summary))
    text = report_page([skfsink.load(copy)])
    checked(text)
    assert "of the whole: energy × 2, load × 2, displacement × 1" in text
    assert f"<td>{summary['quantities']['U']:.4g}</td>" in text.split("of the whole sample: U at the first arrival")[1]


def test_plates_beside_bodies_in_space_keep_their_units() -> None:
    """Fails if energies in N mm/mm and in N mm stand in one column without saying which is which."""
    folders = [data_folder(case) / "reference" / key for case, key in (
        ("single_edge_notch", "M3-dynamic"), ("dog_bone", "paper-quasistatic"))]
    text = report_page([skfsink.load(folder) for folder in folders])
    checked(text)
    row = re.search(r'<th scope="row">U at the first arrival</th>(.*?)</tr>', text)
    assert row and re.findall(r"([\d.]+ N mm(?:/mm)?)<", row[1])[0] == "0.06373 N mm/mm"
    assert row[1].count(" N mm<") == 1
    assert text.count("the folder holds no pictures") == 2


def test_citation_is_that_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a report prints anything else than CITATION.cff has, or the file names another version than this."""
    text = shipped.citation_file().read_text(encoding="utf-8")
    printed = " ".join(citation.citations()) + citation.bibtex()
    found = re.findall(r'^\s*(?:- )?(title|version|family-names|given-names|journal|doi): "?([^"\n]+)"?$', text, re.M)
    assert len(found) == 11 and ("version", skfsink.__version__) in found
    for name, value in found:
        if name != "given-names":
            assert printed.count(value) >= 2, value
        else:
            assert value in printed
    assert re.search(r'date-released: "(\d+)', text)[1] in citation.citations()[0]  # type: ignore[index]
    (tmp_path / "CITATION.cff").write_text(text.replace("Jabareen", "Someone"), encoding="utf-8")
    monkeypatch.setattr(citation, "citation_file", lambda: tmp_path / "CITATION.cff")
    citation._entries.cache_clear()
    try:
        assert "Someone, Mahmood" in citation.bibtex() and "Jabareen" not in citation.bibtex()
    finally:
        citation._entries.cache_clear()


def test_references_as_text_and_bibtex() -> None:
    """Fails if initials, the comma before `and`, the braces of an organisation or the key of an entry are wrong."""
    assert citation.citations()[1].startswith("Abu-Qbeitah, S., Jabareen, M., and Volokh, K. Y. Dynamic Versus")
    for line in ("@software{skfsink,\n", "  author  = {{The skfsink developers}},\n", "@article{AbuQbeitah2022,\n",
                 "  author  = {Abu-Qbeitah, Suhib and Jabareen, Mahmood and Volokh, Konstantin Y.},\n"):
        assert line in citation.bibtex()


def run_command(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[Any, str, str]:
    """Exit status, output and errors of the command."""
    with pytest.raises(SystemExit) as end:
        command(report, [str(a) for a in arguments], package="commands")
    return end.value.code, *capsys.readouterr()


def test_the_command_says_where_the_page_is(copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    """Fails if the page is not where it is said to be, or an error is not one line and exit status 2."""
    monkeypatch.chdir(tmp_path)
    assert run_command(capsys, copy) == (0, f"{copy / 'report.html'}\n", "")
    assert (copy / "report.html").read_text().startswith("<!DOCTYPE html>")
    assert run_command(capsys, "run", "run") == (0, "comparison.html\n", "")
    assert run_command(capsys, "run", "--out", "a.html") == (0, "a.html\n", "")
    for arguments, said in (((), "name at least one folder of a run"), (("none",), "none holds no run"),
                            (("run", "--out", copy), "that is a folder; name a file with --out")):
        status, out, err = run_command(capsys, *arguments)
        assert (status, out) == (2, "") and said in err and err.count("\n") == 1


# --- in a browser ---
def seen(browser: Any, path: Path, width: int) -> dict[str, Any]:
    """What a browser makes of a page in a window of that width."""
    page = browser.new_page(viewport={"width": width, "height": 800}, offline=True)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith("data:") else said.append(request.url))
    page.goto(path.absolute().as_uri(), wait_until="load")
    found: dict[str, Any] = page.evaluate("""() => ({
        title: document.title, tables: document.querySelectorAll("table").length,
        broken: [...document.images].filter(i => !(i.complete && i.naturalWidth > 0)).length,
        images: document.images.length, wide: document.documentElement.scrollWidth - window.innerWidth,
        hidden: [...document.querySelectorAll("main img, main table, h2")].filter(e => e.offsetWidth < 50).length,
        font: getComputedStyle(document.querySelector("h1")).fontWeight,
        dead: [...document.querySelectorAll("nav a")].filter(a => !document.querySelector(a.hash)).length})""")
    page.close()
    return found | {"said": said}


def test_folders_of_a_report_may_be_texts(folder: Path, tmp_path: Path) -> None:
    """Fails if a folder that is a text, or a single one without a list, ends in an error of Python."""
    assert write_report([str(folder)], str(tmp_path / "page.html")).is_file()
    with pytest.raises(OutputError, match=re.escape(f"write ['{folder}']")):
        write_report(str(folder))


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 360])
def test_a_browser_shows_the_report(folder: Path, browser: Any, tmp_path: Path, width: int) -> None:
    """Fails if a picture does not appear, the page asks for anything else or complains, or it is wider than the
    window."""
    path = write_report([folder], tmp_path / "page.html")
    found = seen(browser, path, width)
    assert found["said"] == [path.absolute().as_uri()]
    assert found["title"].startswith("Single edge notch, mesh plate, dynamic and quasi-static")
    assert found["images"] == 13 and found["tables"] == 6
    assert (found["broken"], found["hidden"], found["dead"], found["wide"]) == (0, 0, 0, 0)
    assert found["font"] == "700"  # the style is let in by the page's own policy


@pytest.mark.slow
def test_the_browser_would_see_a_broken_page(folder: Path, browser: Any, tmp_path: Path) -> None:
    """Fails if the checks above pass a page with a damaged picture, a script, or a picture from elsewhere."""
    text = report_page([skfsink.load(folder / "dynamic")])
    text = text.replace("data:image/png;base64,", "data:image/png;base64,#", 1)
    (tmp_path / "page.html").write_text(text.replace(
        "<main>", '<main><img src="https://example.org/x.png" alt=""><script>let x = 1</script>'))
    found = seen(browser, tmp_path / "page.html", 1280)
    assert found["broken"] == 2
    assert sum("Content Security Policy" in said for said in found["said"]) >= 2  # nothing is loaded or run


def test_frames_are_read_by_meshio_alone(folder: Path) -> None:
    """Fails if the series is not what any reader of VTU files takes."""
    path = folder / "quasistatic" / "series" / "run_0000.vtu"
    assert meshio.read(path).cell_data["von_mises"][0].min() >= 0

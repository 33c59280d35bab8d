"""The page about runs that go on: what it shows of every kind of folder, whom it answers, and that it only reads."""

from __future__ import annotations

import http.client
import json
import os
import platform
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from guarded import NOTCHED, scene
from pages import Page
from plates import SMALL, forked, invoke, invoke_program, plate

from skfsink.errors import Interrupted, OutputError
from skfsink.meshing.vtu import write_mesh
from skfsink.results.status import STATUS, Status
from skfsink.results.stored_series import pack_series
from skfsink.run import told
from skfsink.run.compute import run
from skfsink.run.display import Display
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.view import View
from skfsink.run.occupied import HOLDER, Holder, occupied
from skfsink.watch.drawn import Drawn, Pictures
from skfsink.watch.page import Watch
from skfsink.watch.places import labelled, places
from skfsink.watch.seen import duration, look
from skfsink.watch.server import Server


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small plate. Tests do not change it."""
    root = tmp_path_factory.mktemp("watched")
    write_mesh(root / "plate.vtu", plate())
    status, err, _ = invoke("--mesh", root / "plate.vtu", "--out", root / "done", "--frame-every", "2e-6",
                            "--event-time", "8e-6", *SMALL)
    assert (status, err) == (0, "")
    return root / "done"


@pytest.fixture
def copy(done: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    return Path(shutil.copytree(done, tmp_path / "plate"))


def status_of(**changes: Any) -> Status:
    """How far a run is."""
    return Status(**{"phase": "dynamic", "phase_began": time.time() - 60, "written": time.time(), "fraction": 0.25,
                     "left_s": 185.0, "figures": "5.0 µs  no tip yet", "lines": ("loading", "dynamic 25%"), **changes})


def goes_on(folder: Path, process: int = 0, host: str = "", since: str = "", **changes: Any) -> Path:
    """Make a folder that of a run that goes on, in this process unless another is named."""
    (folder / "summary.json").unlink(missing_ok=True)
    (folder / STATUS).write_text(status_of(**changes).text())
    (folder / HOLDER).write_text(json.dumps({
        "process": process or os.getpid(), "host": host or platform.node(),
        "since": since or datetime.now().astimezone().isoformat(" ", "seconds")}))
    return folder


def seen(folder: Path) -> tuple[str, str]:
    """State of a run, and what is said of it."""
    found = look(places(folder)[0])
    return found.state, found.text


# --- what a run says of itself ---
class Reader(Observer):
    """Reads the status of its run at every look, and may end it."""

    every = None

    def __init__(self, error: BaseException | None = None) -> None:
        self.found: list[Status | None] = []
        self.error = error

    def look(self, view: View) -> None:
        self.found.append(Status.read(view.folder))
        if self.error and len(self.found) > 4:
            raise self.error


def test_a_run_says_how_far_it_is_and_leaves_no_word_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the file is not there while the run goes on, is there after its end, or is written more than allowed."""
    written = []
    monkeypatch.setattr(told, "write_atomic", lambda *args, **kinds: (written.append(time.monotonic()),
                                                                      Path(args[0]).write_text(args[1])))
    reader = Reader()
    of = scene(NOTCHED.sample, event_time=3e-7, overshoot=0.01, record_every=1e-8)
    run(of, tmp_path / "run", [reader], quiet=True)
    during = [status for status in reader.found if status is not None]
    assert len(during) == len(reader.found) > 5 and during[-1].phase == "dynamic"
    assert 0.0 <= during[-1].fraction <= 1.0 and any("elements" in line for line in during[-1].lines)
    assert any("notch" in text for text in during[-1].warnings) and not during[-1].ended
    assert not (tmp_path / "run" / STATUS).exists()
    phases = ["", "loading", "dynamic", "output"]  # a word each, and else one a second
    assert len(written) <= len(phases) + (written[-1] - written[0]) / told.EVERY


@pytest.mark.parametrize("error, state, text", [
    (OutputError("the disk is full"), "failed", "the disk is full"), (Interrupted("interrupted"), "interrupted", "")])
def test_a_run_that_ends_before_its_end_says_why(error: Exception, state: str, text: str, tmp_path: Path) -> None:
    """Fails if what ended a run is not in its folder, or another run in it still has the word of the first."""
    of = scene(NOTCHED.sample, event_time=3e-7, overshoot=0.01, record_every=1e-8)
    with pytest.raises(type(error)):
        run(of, tmp_path / "run", [Reader(error)], quiet=True)
    assert seen(tmp_path / "run") == (state, text)
    assert not (tmp_path / "run" / HOLDER).exists()


def test_a_status_that_cannot_be_written_ends_nothing(tmp_path: Path) -> None:
    """Fails if a run stops because nobody can be told of it."""
    display = Display(True)
    with told.told(tmp_path / "nowhere", display, list):
        display.phase("loading")
        display.update(0.5, "half")
    assert not (tmp_path / "nowhere").exists()
    with pytest.raises(ValueError, match="first"), told.told(tmp_path, display, lambda: ["careful"]):
        raise ValueError("first\nsecond")
    found = Status.read(tmp_path)
    assert found and (found.ended, found.warnings, found.figures) == ("first", ("careful",), "half")
    display.update(0.7, "more")  # of nobody's any more
    assert Status.read(tmp_path) == found


# --- what is seen of a folder ---
def test_states_of_a_run(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run that goes on, was killed, or is on another machine is taken for one of the others."""
    assert seen(copy)[0] == "finished" and "began" not in seen(copy)[1]
    goes_on(copy)
    assert seen(copy) == ("running", "")
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    goes_on(copy, gone.pid)
    assert seen(copy) == ("killed", "its process is gone")
    goes_on(copy, since="2001-01-01 00:00:00+00:00")  # the number of the process is another's now
    assert seen(copy)[0] == "killed"
    goes_on(copy, host="elsewhere")
    assert seen(copy) == ("running", "")
    os.utime(copy / STATUS, (time.time() - 700, time.time() - 700))
    assert seen(copy) == ("silent", "no word for 11 min 40 s; whether it goes on is known on elsewhere alone")
    goes_on(copy)
    os.utime(copy / STATUS, (time.time() - 90, time.time() - 90))
    assert seen(copy) == ("running", "no word for 1 min 30 s: what it does takes long, or it hangs")
    (copy / HOLDER).unlink(), (copy / STATUS).unlink()
    assert seen(copy) == ("interrupted", "no process is in it")


def test_a_holder_is_this_process_while_it_is_in_the_folder(tmp_path: Path) -> None:
    """Fails if the process of a lock is not the one that has it."""
    with occupied(tmp_path):
        found = Holder.read(tmp_path)
        assert found and found.process == os.getpid() and found.alive is True
    assert Holder.read(tmp_path) is None


def test_torn_files_are_said_and_end_nothing(copy: Path) -> None:
    """Fails if a half-written line or frame, a damaged file or one that vanishes ends the page, or goes unsaid."""
    goes_on(copy)
    whole = (copy / "history.csv").read_text()
    rows = len(look(places(copy)[0]).history["step"])  # type: ignore[index]
    (copy / "history.csv").write_text(whole + "event,3,1e-")
    assert len(look(places(copy)[0]).history["step"]) == rows  # type: ignore[index]
    frames = sorted((copy / "series").glob("run_*.vtu"))
    frames[-1].write_bytes(frames[-1].read_bytes()[:300])
    watch = Watch([copy])
    assert "not drawn" not in watch.page()
    drawn = watch.picture("density-0.png")
    last = re.search(r"at ([\d.]+) µs$", drawn.alt)  # type: ignore[union-attr]
    times = re.findall(r'timestep="([^"]+)"', (copy / "series" / "run.pvd").read_text())
    assert drawn and last and float(last[1]) == pytest.approx(1e6 * float(times[-2]), abs=0.06)
    for frame in frames:
        frame.write_bytes(b"<VTKFile")
    (copy / "series" / "run.pvd").write_text((copy / "series" / "run.pvd").read_text() + " ")
    assert Watch([copy]).page() and (again := Watch([copy])).page() and again.picture("density-0.png") is None
    assert re.search(r"run_\d+.vtu is missing or damaged", again.failure("density-0.png"))
    assert "<strong>not drawn: " in again.page()
    for name, text in (("history.csv", "1,2"), (STATUS, "{"), ("scene.toml", "case = ")):
        kept = (copy / name).read_text()
        (copy / name).write_text(text)
        state, said = seen(copy)
        assert state == "running" and name in said
        assert name in Watch([copy]).page()
        (copy / name).write_text(kept)
    (copy / HOLDER).unlink(), (copy / STATUS).write_text("{")
    assert seen(copy)[0] == "damaged"


def test_frames_in_one_file_are_drawn(copy: Path) -> None:
    """Fails if the body of a run whose frames were packed into one file is not shown."""
    pytest.importorskip("h5py")
    for name in ("run", "loading"):
        pack_series(copy / "series", name)
    assert not list((copy / "series").glob("*.pvd"))
    watch = Watch([copy])
    assert "density-0.png" in watch.page()
    drawn = watch.picture("density-0.png")
    assert drawn is not None and drawn.content.startswith(b"\x89PNG")


def test_a_run_that_vanishes_is_gone(copy: Path) -> None:
    """Fails if the page ends with the folder, or does not see a run that is begun there again."""
    watch = Watch([copy])
    assert 'class="state finished"' in watch.page()
    shutil.move(copy, copy.parent / "away")
    assert 'class="state gone"' in watch.page()
    shutil.move(copy.parent / "away", copy)
    assert 'class="state finished"' in watch.page()


def test_runs_of_a_sweep_and_of_a_folder(done: Path, copy: Path, tmp_path: Path) -> None:
    """Fails if runs of a sweep are missing, out of the order of their values, under no name, or without their state."""
    sweep = tmp_path / "sweep"
    for seed in (10, 2, 1):
        (sweep / f"seed={seed}").mkdir(parents=True)
        (sweep / f"seed={seed}" / "deck.toml").write_text('case = "single_edge_notch"\n')
    shutil.copytree(done, sweep / "seed=2" / "run")
    (sweep / "seed=1" / "failure.txt").write_text("the body finds no equilibrium\nat all\n")
    found = labelled([*places(sweep), *places(copy), *places(copy)])
    assert [place.label for place in found] == ["seed=1", "seed=2", "seed=10", "plate"]
    assert [(one.state, one.text.partition(",")[0]) for one in map(look, found)] == [
        ("failed", "the body finds no equilibrium"), ("finished", look(found[1]).text.partition(",")[0]),
        ("waiting", ""), ("finished", look(found[3]).text.partition(",")[0])]
    page = Watch([sweep, copy]).page()
    assert re.findall(r'<th scope="row"><a href="\?run=(\d)">([^<]+)</a>', page) == [
        ("0", "seed=1"), ("1", "seed=2"), ("2", "seed=10"), ("3", "plate")]
    assert "2 finished, 1 failed" in page and "<h3>seed=10</h3>" not in page  # what has not begun has nothing to show
    alone = Watch([sweep]).page([1])
    assert "density-1.png" in alone and "<h3>seed=2</h3>" in alone and "<h3>seed=1</h3>" not in alone
    assert [place.label for place in labelled(places(tmp_path))] == ["plate"]  # a folder of runs


def test_both_analyses_are_two_runs(copy: Path, tmp_path: Path) -> None:
    """Fails if the parts of a run of both analyses are not found as they begin."""
    both = tmp_path / "both"
    both.mkdir()
    (both / "scene.toml").write_text((copy / "scene.toml").read_text().replace('"dynamic"', '"both"'))
    assert [place.folder.name for place in places(both)] == ["both"]
    shutil.copytree(copy, both / "dynamic")
    assert [place.folder.name for place in places(both)] == ["dynamic"]


def test_a_run_that_is_being_prepared_is_shown(tmp_path: Path) -> None:
    """Fails if a folder that a process has, without a scene yet, is no run."""
    with occupied(tmp_path):
        assert seen(tmp_path) == ("running", "")
        Page(Watch([tmp_path]).page())


@pytest.mark.parametrize("seconds, said", [(0.4, "0 s"), (42, "42 s"), (185, "3 min 5 s"), (120, "2 min"),
                                           (8040, "2 h 14 min"), (3 * 86400 + 4 * 3600, "3 d 4 h")])
def test_durations(seconds: float, said: str) -> None:
    """Fails if a time is said wrongly."""
    assert duration(seconds) == said


# --- the page ---
def test_the_page_says_what_the_run_says(copy: Path) -> None:
    """Fails if progress, time left, figures, warnings or the log are not on the page, or are taken for markup."""
    goes_on(copy, warnings=("l/h < 1.2 <script>alert(1)</script>",), lines=("one", "dynamic 25%  <b>"))
    text = Watch([copy]).page()
    page = Page(text)
    assert len(page.all("h1")) == 1 and page.all("html")[0] == {"lang": "en", "data-goes-on": "yes"}
    assert [bar["value"] for bar in page.all("progress")] == ["0.250"]
    for expected in ("about 3 min 5 s left", "5.0 µs  no tip yet", "&lt;script&gt;", "dynamic 25%  &lt;b&gt;",
                     f"Process {os.getpid()} on ", "25% event, dynamic – plate – skfsink"):
        assert expected in text, expected
    assert [script["src"] for script in page.all("script")] == ["watch.js"] and "alert(1)</script>" not in text
    for attributes in (a for _, a in page.tags):
        for name in ("src", "href"):  # relative, so that the page may be anywhere
            assert re.match(r"data:,|#|watch\.js|picture/|\?run=|\./$", attributes.get(name) or "#")
    assert "url(" not in text and "@import" not in text
    for image in page.all("img"):
        assert len(image["alt"] or "") > 20
    ids = {a["id"] for _, a in page.tags if "id" in a}
    assert {a["href"] for a in page.all("a")} <= {f"#{name}" for name in ids}
    rows = dict(re.findall(r'<th scope="row">([^<]+)</th><td>([^<]*)', text))
    last = look(places(copy)[0]).history
    assert last is not None and rows["time since onset"] == f"{1e6 * last['time_s'][-1]:.4g}"
    assert rows["load"] == f"{last['reaction_N_per_mm'][-1]:.4g}"


def test_pictures_are_drawn_when_their_files_change_and_not_too_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a picture is drawn twice for the same files, stays old, or takes more than its share of the time."""
    pictures, clock, cost, calls = Pictures(), [100.0], [0.0], []
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(time, "thread_time", lambda: cost[0])

    def offer(stamp: int) -> int:
        def draw() -> Drawn:
            calls.append(stamp)
            cost[0] += 1.0
            return Drawn("image/png", bytes([stamp]), f"picture {stamp}")
        return pictures.offer("a", stamp, draw)

    assert pictures.get("a") is None and offer(1) == 1 and pictures.alt("a", "soon") == "soon"
    assert pictures.get("a") == pictures.get("a") == Drawn("image/png", b"\1", "picture 1") and calls == [1]
    clock[0] += 10.0
    assert offer(2) == 1 and calls == [1]  # it took a second: it rests for twenty
    clock[0] += 11.0
    assert offer(2) == 2 and pictures.get("a").content == b"\2"  # type: ignore[union-attr]
    assert pictures.alt("a", "") == "picture 2" and calls == [1, 2]
    clock[0] += 60.0
    assert pictures.offer("a", 3, lambda: 1 / 0) == 3  # type: ignore[arg-type,return-value]
    assert pictures.get("a").content == b"\2"  # type: ignore[union-attr]
    assert pictures.failure("a") == "division by zero"


# --- the server ---
@contextmanager
def served(*folders: Path) -> Iterator[Callable[..., tuple[int, dict[str, str], bytes]]]:
    """Ask a server of these folders: status, headers and content of the answer."""
    with Server(Watch(folders), port=0) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()

        def ask(path: str = "/", method: str = "GET", **headers: str) -> tuple[int, dict[str, str], bytes]:
            link = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=60)
            link.putrequest(method, path, skip_host="Host" in headers)
            for name, value in headers.items():
                link.putheader(name.replace("_", "-"), value)
            link.endheaders()
            answer = link.getresponse()
            content = answer.read()
            link.close()
            return answer.status, dict(answer.getheaders()), content

        ask.url = server.url  # type: ignore[attr-defined]
        yield ask
        server.shutdown()
        thread.join()


def test_nothing_is_written_in_the_folder(copy: Path) -> None:
    """Fails if watching leaves, changes or touches a file, or takes the lock of the run."""
    goes_on(copy)

    def listing() -> dict[str, tuple[int, int]]:
        return {str(path): (path.stat().st_mtime_ns, path.stat().st_size) for path in (copy, *copy.rglob("*"))}

    before = listing()
    with served(copy) as ask:
        _, _, content = ask()
        pictures = re.findall(r'src="(picture/[^"]+)"', content.decode())
        assert len(pictures) >= 4
        for source in pictures:
            status, headers, content = ask(f"/{source}")
            assert status == 200 and headers["Content-Type"].startswith("image/"), content
            assert content.startswith((b"\x89PNG", b"<?xml"))
        assert ask()[0] == 200
    assert listing() == before


def test_only_this_machine_is_answered(done: Path) -> None:
    """Fails if a page of elsewhere, whose name was made to lead here, gets an answer; or a tunnel gets none."""
    with served(done) as ask:
        for name in ("evil.example", "evil.example:8765", "127.0.0.1.evil.example", "localhost.evil.example", "",
                     "192.168.0.7", "[::2]:80", "0.0.0.0"):
            status, _, content = ask(Host=name)
            assert status == 403 and b"plate" not in content, name
        for name in ("localhost", "LocalHost:9000", "127.0.0.1:1234", "[::1]:8765", "[::1]", "127.0.0.2"):
            assert ask(Host=name)[0] == 200, name  # whatever the port is at the other end of a tunnel
        assert ask("/watch.js", Host="evil.example")[0] == 403


@pytest.mark.parametrize("path", [
    "/../../../../etc/passwd", "/picture/../../scene.toml", "/picture/%2e%2e/%2e%2e/summary.json", "/summary.json",
    "/picture/density-99.png", "/picture/0/../density-0.png", "//etc/passwd", "/picture/..%2f..%2fhistory.csv",
    "/watch.css", "/page.html", "/%00", "/picture/", "/[", "/picture/density-0.png/x"])
def test_no_address_leads_into_the_disk(path: str, done: Path) -> None:
    """Fails if anything but the page, its script and the pictures it offers can be asked for."""
    with served(done) as ask:
        ask()
        assert ask(path)[0] == 404


def test_answers_tell_browsers_what_is_allowed(done: Path) -> None:
    """Fails if an answer may load from elsewhere or run a script of its own, or the same page is sent twice."""
    with served(done) as ask:
        for path in ("/", "/watch.js", "/nothing"):
            _, headers, _ = ask(path)
            assert "default-src 'none'" in headers["Content-Security-Policy"]
            assert "script-src 'self';" in headers["Content-Security-Policy"]
            assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cache-Control"] == "no-cache"
        tag = ask()[1]["ETag"]
        status, headers, content = ask(If_None_Match=tag)
        assert (status, content, headers["ETag"]) == (304, b"", tag)
        assert ask(If_None_Match='"another"')[0] == 200
        status, headers, content = ask(method="HEAD")
        assert (status, content) == (200, b"") and int(headers["Content-Length"]) > 1000
        assert ask(method="POST")[0] == ask(method="DELETE")[0] == 501
        assert ask("/?run=x&run=-1")[0] == 200


def test_a_page_changes_with_its_run(copy: Path) -> None:
    """Fails if the page stays the same when a run goes on, or changes when nothing does."""
    goes_on(copy)
    with served(copy) as ask:
        tags = {ask()[1]["ETag"] for _ in range(3)}
        assert len(tags) == 1
        goes_on(copy, fraction=0.75)
        assert ask()[1]["ETag"] not in tags


def test_another_host_lets_its_names_in(done: Path) -> None:
    """Fails if the server of a network does not answer to its number, or answers to any name."""
    with Server(Watch([done]), "0.0.0.0", 0) as server:
        assert not server.local
        assert [server.answers_to(name) for name in ("192.168.0.7", platform.node(), "localhost", "evil.example")] == [
            True, True, True, False]


# --- the command ---
def test_errors_are_one_line(tmp_path: Path, done: Path) -> None:
    """Fails if a folder that is no run, a port that is taken or one that cannot be is not one line and status 2."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for arguments, said in (
                ((), "name at least one folder of a run or a sweep"),
                ((tmp_path / "none",), "there is no folder"), ((tmp_path / "file",), "there is no folder"),
                ((tmp_path / "empty",), "empty holds no run and no sweep: there is no scene.toml in it or one folder"),
                ((done, "--port", port), f"port {port} of 127.0.0.1 is taken, perhaps by another skfsink watch: take "
                                         f"another --port, or --port 0 for a free one"),
                ((done, "--port", 70000), "port must be a whole number in [0, 65535]; got 70000"),
                ((done, "--host", "192.0.2.1", "--port", 0), "cannot listen at 192.0.2.1, port 0")):
            status, err, out = invoke_program("watch", *arguments)
            assert (status, out, err.count("\n")) == (2, "", 1) and said in err, err


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_the_command_shows_the_page_until_it_is_stopped(number: signal.Signals, done: Path) -> None:
    """Fails if the address that is printed has no page, or the end is not quiet."""
    heeded = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # a shell may have it ignored
    program = f"{heeded}; from skfsink.__main__ import main; main()"
    child = subprocess.Popen([sys.executable, "-c", program, "watch", str(done), "--port", "0"], text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        assert child.stdout is not None
        address = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\n", child.stdout.readline())
        assert address
        link = http.client.HTTPConnection("127.0.0.1", int(address[1]), timeout=60)
        link.request("GET", "/")
        assert b"<h1" in link.getresponse().read()
        link.close()
        child.send_signal(number)
        out, err = child.communicate(timeout=60)
        assert (child.returncode, out, err) == (0, "", "")
    finally:
        child.kill()
        child.wait()


# --- in a browser ---
def until(page: Any, script: str, seconds: float = 60.0) -> None:
    """Wait until a script in the browser is true; the policy of the page lets it be evaluated from here alone."""
    for _ in range(int(10 * seconds)):
        if page.evaluate(script):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"not true after {seconds:g} s: {script}")


@pytest.mark.parametrize("width", [1300, 400])
def test_a_browser_follows_a_run(copy: Path, browser: Any, width: int) -> None:
    """Fails if the page does not show how a run goes on without a reload, moves what is read, asks for anything from
    elsewhere, complains, or is wider than the window."""
    goes_on(copy)
    history = (copy / "history.csv").read_text().splitlines(True)
    (copy / "history.csv").write_text("".join(history[:-6]))
    with served(copy) as ask:
        page = browser.new_page(viewport={"width": width, "height": 800})
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda one: None if one.url.startswith((ask.url, "data:")) else said.append(one.url))
        page.goto(ask.url, wait_until="domcontentloaded")
        until(page, "document.images.length >= 4 && [...document.images].every(i => i.complete && i.naturalWidth > 0)")
        page.evaluate("window.mark = 'the same page'; document.getElementById('energies').scrollIntoView()")
        page.wait_for_timeout(200)
        place = page.evaluate("document.getElementById('energies').getBoundingClientRect().top")
        goes_on(copy, fraction=0.6, figures="9.0 µs", lines=("one",) * 30, warnings=("careful",) * 9)
        (copy / "history.csv").write_text("".join(history))
        until(page, "document.querySelector('progress').value == 0.6")
        assert page.evaluate("document.querySelectorAll('.warnings li').length") == 9
        assert "60% event, dynamic" in page.title()
        until(page, "document.querySelector('img[data-picture^=energies]').src.endsWith('v=2')")
        page.wait_for_timeout(300)
        assert abs(page.evaluate("document.getElementById('energies').getBoundingClientRect().top") - place) < 3
        for tag in ("h1", "p", "figcaption"):  # of a title and a path without a space
            page.evaluate(f"document.querySelector('{tag}').textContent = 'title/'.repeat(50)")
        assert page.evaluate("document.documentElement.scrollWidth - window.innerWidth") <= 0
        (copy / HOLDER).unlink(), (copy / STATUS).unlink()
        until(page, "document.querySelector('.state').textContent == 'interrupted'")
        assert page.evaluate("window.mark") == "the same page"
        assert said == []
    page.close()
    assert look(places(copy)[0]).state == "interrupted"


def test_a_browser_says_when_nobody_answers(copy: Path, browser: Any) -> None:
    """Fails if an old page looks like a new one, or a new one is said to be old."""
    with served(goes_on(copy)) as ask:
        page = browser.new_page()
        page.goto(ask.url, wait_until="domcontentloaded")
        assert page.evaluate("document.getElementById('lost').hidden")
        page.context.set_offline(True)
        until(page, "!document.getElementById('lost').hidden")
        page.context.set_offline(False)
        until(page, "document.getElementById('lost').hidden")
        page.close()


@pytest.mark.slow
def test_a_killed_run_is_seen_as_killed(mesh: Path, tmp_path: Path) -> None:
    """Fails if a run that the system ended is taken for one that goes on, or cannot go on after it."""
    arguments = ["--mesh", mesh, "--out", tmp_path / "out", "--event-time", "5e-6", "--checkpoint-every", "0.01",
                 *SMALL]
    assert forked(arguments, stop=40)[0] == -signal.SIGKILL
    assert seen(tmp_path / "out")[0] == "killed"
    assert forked(["--resume", tmp_path / "out", "--quiet"]) == (0, "")
    assert seen(tmp_path / "out")[0] == "finished" and not (tmp_path / "out" / STATUS).exists()

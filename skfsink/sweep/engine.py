"""Who runs the runs of a sweep: processes of this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from ..errors import MissingExtra, OutputError
from .one import FAILURE, finished

__all__ = ["here", "on_scheduler", "start"]


def start(folder: Path, threads: int = 1) -> subprocess.Popen[bytes]:
    """A process that runs the run of a folder."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "MPLBACKEND": "Agg"}
    return subprocess.Popen([sys.executable, "-m", "skfsink.sweep.one", str(folder)], env=environment,
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def here(folders: Sequence[Path], jobs: int) -> Generator[Path, None, None]:
    """Run the folders, `jobs` at a time; yields each when it is done. Interrupted runs leave a checkpoint."""
    children: dict[Path, subprocess.Popen[bytes]] = {}
    stopped = False

    def one(folder: Path) -> Path:
        if not stopped:
            children[folder] = child = start(folder)
            if stopped:  # meanwhile
                child.send_signal(signal.SIGINT)
            child.wait()
        return folder

    with ThreadPoolExecutor(jobs) as pool:
        left = {pool.submit(one, folder) for folder in folders}
        try:
            while left:
                done, left = wait(left, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        except BaseException:
            stopped = True
            for child in children.values():
                if child.poll() is None:
                    child.send_signal(signal.SIGINT)
            raise


def on_scheduler(folders: Sequence[Path], address: str) -> Generator[Path, None, None]:
    """Run the folders on the workers of the Dask scheduler at `address`, which must see the same files.

    A task whose worker dies is given to another one, which waits for a run that goes on without its worker, and takes
    up one that does not.

    Raises
    ------
    MissingExtra, OutputError
        Dask is not installed; the scheduler does not answer.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise MissingExtra(f"a scheduler needs Dask, which cannot be imported ({error}): "
                           f"install skfsink[sweep]") from None
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise OutputError(f"the scheduler {address} does not answer: {error or type(error).__name__}") from None
    with client:
        futures = [client.submit(_task, str(folder), pure=False, retries=3) for folder in folders]
        for future in as_completed(futures, loop=client.loop):
            yield Path(future.result())


def _task(folder: str) -> str:
    child: Any = start(Path(folder))
    child.wait()
    if child.returncode and not finished(Path(folder)) and not (Path(folder) / FAILURE).exists():
        raise RuntimeError(f"the run in {folder} was killed")  # Dask tries again
    return folder

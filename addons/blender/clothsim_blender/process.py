"""The simulation as a process of its own: Blender's Python has another NumPy than clothsim needs."""

import json
import shlex
import subprocess
import threading
from contextlib import suppress
from pathlib import Path

RUN, CACHE = "run", "cache.pc2"


class Simulation:
    """`clothsim run` and then `clothsim export` in a folder; `poll` says how far it is."""

    def __init__(self, command: str, scene: Path) -> None:
        self.command = shlex.split(command)
        self.folder = scene.parent
        self.message, self.fraction = "starting", 0.0
        self._lines: list[str] = []
        arguments = ["run", scene.name, "-o", RUN, "--overwrite", "--no-picture", "--json"]
        self._process = self._start(arguments)

    @property
    def cache(self) -> Path:
        """Point cache of the cloth."""
        return self.folder / CACHE

    def _start(self, arguments: list[str]) -> subprocess.Popen:
        process = subprocess.Popen(
            [*self.command, *arguments],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
        )
        self._listener = threading.Thread(target=self._listen, args=(process,), daemon=True)
        self._listener.start()
        return process

    def _listen(self, process: subprocess.Popen) -> None:
        for line in process.stderr:
            try:
                event = json.loads(line)
            except ValueError:
                self._lines.append(line.strip())
                continue
            if event.get("event") == "progress":
                self.fraction = float(event.get("time", 0.0)) / (float(event.get("duration", 0.0)) or 1.0)
                self.message = f"{event.get('time', 0.0):.2f} of {event.get('duration', 0.0):g} s"
            elif event.get("event") == "error":
                self._lines.append(f"{event.get('sentence', '')} {event.get('remedy', '')}".strip())
            elif event.get("text"):
                self._lines.append(str(event["text"]).strip())

    def running(self) -> bool:
        """True while the simulation is still going."""
        return self._process.poll() is None

    def wait(self, seconds: float) -> None:
        """Wait for its end, at most so long [s]."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)

    def stop(self) -> None:
        """End it; what was simulated stays in the folder."""
        self._process.terminate()

    def export(self, frames_per_second: float) -> Path:
        """The frames as a point cache. RuntimeError with the sentence of clothsim where it failed."""
        if not (self.folder / RUN / "trajectory.vtkhdf").is_file():
            raise RuntimeError(self.reason())
        arguments = ["export", RUN, "-o", CACHE, "--fps", f"{frames_per_second:g}", "--overwrite", "--quiet"]
        done = subprocess.run([*self.command, *arguments], cwd=self.folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr.strip() or "The frames could not be exported.")
        return self.cache

    def reason(self) -> str:
        """Sentence of the failure."""
        summary = self.folder / RUN / "summary.json"
        if summary.is_file():
            return str(json.loads(summary.read_text(encoding="utf-8")).get("reason", ""))
        self._listener.join(1.0)  # the last lines of a process that has ended
        return self._lines[-1] if self._lines else "clothsim left no frame."

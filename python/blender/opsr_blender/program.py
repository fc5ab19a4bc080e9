"""The program opsr as a process: its words, its progress, its end."""

import json
import os
import pathlib
import shutil
import subprocess

# Exit code of a render that was stopped, with the samples so far.
STOPPED = 5


# Variable by which the program finds Open Image Denoise, and folders of an installation of it or of Blender that may have it.
DENOISER = "OIDN_DIR"
FOLDERS = [".", "lib", "bin", "blender.shared"]


class NoProgram(Exception):
    """The program cannot be had."""


def find(wanted):
    """The path of a program by its name or path."""
    found = shutil.which(wanted)
    if found is None:
        raise NoProgram(f"{wanted}: no such program; the add-on's preferences name it")
    return found


def denoiser(installation):
    """The folder of Open Image Denoise: the one that a variable names, or that of Blender; None without one."""
    places = [os.environ.get(DENOISER), installation]
    folders = [pathlib.Path(place, folder) for place in places if place for folder in FOLDERS]
    return next((str(folder) for folder in folders if any(folder.glob("*OpenImageDenoise.*"))), None)


def first_line(said):
    """The first line of the program's message without its label."""
    for line in said.splitlines():
        line = line.strip()
        if line and "WARN" not in line and "INFO" not in line:
            return line.removeprefix("opsr: ").removeprefix("Error: ").removeprefix("error: ")
    return ""


def warnings(said):
    """Lines that the program warns with, without their time and label."""
    return [line.split("WARN", 1)[1].strip() for line in said.splitlines() if "WARN" in line]


class Render:
    """A render that runs beside Blender and writes the picture so far into a file."""

    def __init__(self, words, output, save_every="1s", denoiser=None):
        self.output = pathlib.Path(output)
        self.output.unlink(missing_ok=True)
        self.spp, self.fraction, self.error, self.left = 0, 0.0, None, None
        self.seen, self.rest, self.heard, self.stopped = None, b"", 0, False
        self.said = open(self.output.with_suffix(".txt"), "w+", encoding="utf-8", errors="replace")
        self.told = open(self.output.with_suffix(".json"), "wb")
        words = [*words, "-o", self.output, "--save-every", save_every, "--progress", "json", "--exr", "none"]
        group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if os.name == "nt" else {}
        env = {**os.environ, DENOISER: denoiser} if denoiser else None
        self.process = subprocess.Popen([str(w) for w in words], stdout=self.told, stderr=self.said, env=env, **group)

    def running(self):
        """True until the program ends; hears what it says."""
        alive = self.process.poll() is None
        # With a handle of its own: the program's knows where it writes.
        with open(self.told.name, "rb") as told:
            told.seek(self.heard)
            new = told.read()
        self.heard += len(new)
        self.hear(new)
        return alive

    def hear(self, new):
        """Takes lines of progress."""
        *lines, self.rest = (self.rest + new).split(b"\n")
        for line in lines:
            try:
                said = json.loads(line)
            except ValueError:
                continue
            self.spp, self.fraction = said.get("spp", 0), said.get("fraction") or 0.0
            self.error, self.left = said.get("error"), said.get("eta")

    def status(self):
        """A line that says where it stands."""
        words = [f"{self.spp} samples"]
        if self.error is not None:
            words.append(f"error {self.error:.4f}")
        if self.left is not None:
            words.append(f"{self.left:.0f} s left")
        return ", ".join(words)

    def fresh(self):
        """True if a picture was written since the last call."""
        try:
            stamp = self.output.stat().st_mtime_ns
        except OSError:
            return False
        is_new, self.seen = stamp != self.seen, stamp
        return is_new

    def stop(self):
        """Asks for the picture so far, once: asked twice the program ends without it."""
        if not self.stopped and self.process.poll() is None:
            self.stopped = True
            self.process.send_signal(1 if os.name == "nt" else 2)

    def kill(self):
        """Ends it at once."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.said.close()
        self.told.close()

    def end(self):
        """Waits; returns what went wrong, or None, and the warnings."""
        code = self.process.wait()
        self.running()
        self.said.seek(0)
        said = self.said.read()
        self.said.close()
        self.told.close()
        if code in (0, STOPPED) and self.output.exists():
            return None, warnings(said)
        return first_line(said) or f"opsr ended with code {code}", warnings(said)

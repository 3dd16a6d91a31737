"""What tools/stress runs: braid under limits, and the renders of a case with
what each of them must hold by itself."""

import os
import pathlib
import resource
import subprocess
import tempfile
import threading

from .stress_images import Exr

ROOT = pathlib.Path(__file__).resolve().parents[2]
BRAID = os.environ.get("BRAID", str(ROOT / "build/release/braid"))
SEEDS, MORE_SEEDS = range(1, 3), range(11, 17)
TILE = 8
MOST_GAIN = 3.0
# A file, a program, a library, or a reference.
NEEDS_MORE = {"external", "external-command", "oidn", "ensemble-oracle",
              "ideal"}


class Run:
    """One braid process under limits: exit code, lines of text, seconds of
    processor time, bytes of memory."""

    def __init__(self, arguments, seconds, memory):
        with tempfile.TemporaryFile() as text:
            process = subprocess.Popen([BRAID, *arguments], stdout=text,
                                       stderr=text)
            for limit, most in ((resource.RLIMIT_CPU, seconds),
                                (resource.RLIMIT_AS, 2 * memory + (1 << 30)),
                                (resource.RLIMIT_CORE, 0)):
                resource.prlimit(process.pid, limit, (most, most))
            # Against a process that waits for ever; the processor may be
            # shared by many.
            timer = threading.Timer(60 + 30 * seconds, process.kill)
            timer.start()
            _, status, usage = os.wait4(process.pid, 0)
            timer.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            text.seek(0)
            self.lines = text.read().decode(errors="replace").splitlines()
        self.code = process.returncode
        self.seconds = usage.ru_utime + usage.ru_stime
        self.memory = usage.ru_maxrss * 1024
        self.slow = self.seconds >= seconds
        self.large = self.memory > memory


def registry():
    """Names of the integrators, and of the denoisers and combiners."""
    sections, section = {}, ""
    listing = subprocess.run([BRAID, "--list"], capture_output=True,
                             text=True, check=True).stdout
    for line in listing.splitlines():
        if not line.startswith(" "):
            section = line.strip()
        elif line.strip():
            sections.setdefault(section, []).append(line.split()[0])
    return sections["integrators"], [
        name for name in sections["denoisers"] + sections["combiners"]
        if name not in NEEDS_MORE]


class Renders:
    """The renders of one case, checked one by one. `marks` has a letter per integrator and
    failing combiner, `notes` says what is wrong."""

    def __init__(self, case, folder, integrators, combiners):
        self.case, self.folder = case, folder
        self.integrators = [i for i in integrators
                            if not case.only or i in case.only]
        self.combiners = combiners if case.combine else []
        self.marks = {name: "." for name in self.integrators}
        self.bad_combiners, self.notes = {}, []
        self.samples, self.combined, self.biased = {}, {}, {}
        self.seconds, self.memory, self.checks = 0.0, 0, 0
        self.refused, self.told = False, set()
        self.lock = threading.RLock()

    def fail(self, mark, name, note):
        if (mark, name) in self.told:
            return
        self.told.add((mark, name))
        if name in self.marks:
            self.marks[name] = mark
        elif name in self.combiners:
            self.bad_combiners[name] = mark
        else:
            self.marks = dict.fromkeys(self.marks, mark)
        self.notes.append(f"{name}: {note}" if name else note)

    def failed(self):
        return self.bad_combiners or set(self.marks.values()) - set(".o")

    # -- rendering --

    def path(self, suffix):
        return str(self.folder / (self.case.name.replace(" ", "_") + suffix))

    def write(self):
        with open(self.path(".glb"), "wb") as file:
            file.write(self.case.build().to_bytes())
        if self.case.environment:
            with open(self.path(".env.exr"), "wb") as file:
                file.write(self.case.environment())

    def clean(self):
        for suffix in (".glb", ".env.exr", ".exr"):
            pathlib.Path(self.path(suffix)).unlink(missing_ok=True)

    def command(self, seed, integrators, combiners):
        case = self.case
        command = ["render", self.path(".glb"), "-o", self.path(".exr"),
                   "--size", case.size, "--spp", str(case.spp), "--seed",
                   str(seed), "--threads", "1", "--float", "--save-every",
                   "0", "--integrator", ",".join(integrators), *case.options]
        if case.environment:
            command += ["--env", self.path(".env.exr")]
        if len(integrators) == 1 and case.spp < 4:
            return command + ["--aovs", "none", "--combine", "none"]
        command += ["--aovs", "all", "--quarters"]
        if combiners:
            command += ["--history", "--combine", ",".join(combiners)]
        else:
            command += ["--combine", "none"]
        return command

    def run(self, seed, integrators, combiners):
        run = Run(self.command(seed, integrators, combiners),
                  self.case.seconds, self.case.memory)
        self.seconds += run.seconds
        self.memory = max(self.memory, run.memory)
        return run

    def render(self, seed, combiners=()):
        """All integrators in one process; when that fails, one by one to
        say which. Returns the image, or None."""
        run = self.run(seed, self.integrators, combiners)
        if self.check_exit(run, ""):
            return self.image(run)
        if self.refused or len(self.integrators) + len(combiners) == 1:
            return None
        self.marks, self.notes, self.told = dict.fromkeys(
            self.marks, "."), [], set()
        for name in self.integrators:
            self.check_exit(self.run(seed, [name], []), name)
        if not self.failed():
            for name in combiners:
                self.check_exit(self.run(seed, self.integrators, [name]),
                                name)
        if not self.failed():
            self.fail("X", "", "only together")
        return None

    def check_exit(self, run, name):
        """Whether there is an image to look at."""
        self.checks += 1
        case, said = self.case, [line for line in run.lines if line.strip()]
        if run.slow:
            self.fail("t", name, f"more than {case.seconds} s")
        elif run.large:
            self.fail("m", name, f"{run.memory >> 20} MiB")
        elif run.code != case.code:
            self.fail("X", name, f"exit code {run.code}: "
                      + (said[-1] if said else "nothing said"))
        elif case.code:
            self.refused = True
            if len(said) == 1 and case.says in said[0]:
                self.marks = dict.fromkeys(self.marks, "o")
            else:
                self.fail("X", name, f"refused with {len(said)} lines: "
                          + " / ".join(said))
        elif case.says and not any("warning" in line and case.says in line
                                   for line in said):
            self.fail("X", name, f"no warning of '{case.says}'")
        else:
            return True
        return False

    def image(self, run):
        """Checks every channel; returns the file, unless it is too large."""
        if self.case.spp < 4:
            return self.large_image()
        image = Exr(self.path(".exr"))
        bad = {}
        self.checks += len(image.planes)
        for plane in image.not_finite():
            layer = plane.removeprefix("combined.").split(".")
            bad.setdefault(layer[0], set()).add(layer[1] if plane.count(".")
                                                > 1 else plane)
        for owner, layers in bad.items():
            self.fail("n", owner, f"not finite: {' '.join(sorted(layers))}")
        rejected = image.integer("braid/rejectedSamples")
        if rejected:
            said = [line.split("braid replay ")[1] for line in run.lines
                    if "braid replay " in line]
            name = said[0].split("--integrator ")[1].split()[0] if said else ""
            self.fail("r", name, f"{rejected} samples rejected by all "
                      "integrators together: " + " ".join(said))
        return image

    def large_image(self):
        run = Run(["compare", self.path(".exr"), self.path(".exr"),
                   "--metric", "MSE", "--json"], 300, self.case.memory * 2)
        if not any('"invalidPixels": 0' in line for line in run.lines):
            self.fail("n", "", "compare: " + " ".join(run.lines)[-200:])
        return None

    def measure(self, seeds, combiners=()):
        """Means of the quarters per integrator, over the seeds; nothing when
        a render fails."""
        self.write()
        values = {name: [] for name in self.integrators}
        for i, seed in enumerate(seeds):
            image = self.render(seed, combiners if i == 0 else ())
            if image is None:
                values = {}
                break
            for name in self.integrators:
                self.biased[name] = not image.integer(
                    f"braid/{name}/unbiased")
                values[name] += [image.tile_means(f"{name}.q{q}", TILE)
                                 for q in range(4)]
            if combiners and i == 0:
                self.check_combined(image)
        self.clean()
        return values

    def check_combined(self, image):
        """Filters may take energy away, as they do with fireflies, but none
        may add to what the brightest of their inputs holds."""
        most = max(image.mean(f"{name}.mean") for name in self.integrators)
        for name in self.combiners:
            self.checks += 1
            mean = self.combined[name] = image.mean(f"combined.{name}")
            if mean > MOST_GAIN * most:
                self.fail("g", name, f"mean {mean:.5g}, of the integrators "
                          f"at most {most:.5g}")

    def sample(self, again=False):
        """The usual seeds' values, or the fresh ones'; rendered once."""
        with self.lock:
            if again not in self.samples:
                self.samples[again] = (
                    self.measure(MORE_SEEDS) if again
                    else self.measure(SEEDS, self.combiners))
            return self.samples[again]

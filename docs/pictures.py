"""Writes the pictures of the book into docs/src/pictures, with the standard library alone.

    python docs/pictures.py MMS           writes all of them
    python docs/pictures.py MMS --check   writes nothing, and fails where one is not what the program draws

The gallery shows exact motions, by `mms eval`; plots are those of `mms` itself. All are the same on every machine.
"""

import argparse
import json
import math
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
OUT = REPOSITORY / "docs/src/pictures"
PAGE = REPOSITORY / "docs/src/results/gallery.md"
# The colours that mms draws stress in: ten steps of viridis, light is high.
COLOURS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"]
FRAMES = 10
SECONDS = 4
SIDE = 180
EDGE = 12


def mms(program, *arguments, stdin=None):
    done = subprocess.run([program, *arguments], input=stdin, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"mms {' '.join(arguments)} ends with {done.returncode}:\n{done.stderr}")
    return done.stdout


# --- the gallery ---------------------------------------------------------------------------------


def value(text, names):
    """A number of a specification, which may be a formula of its parameters."""
    if not isinstance(text, str):
        return float(text)
    text = text.replace("^", "**")
    known = {**vars(math), "Pi": math.pi, "ln": math.log, "abs": abs}
    for _ in range(20):
        try:
            return float(eval(text, {"__builtins__": {}}, {**known, **names}))  # the repository's own specifications
        except NameError as missing:
            raise ValueError(f"{text}: {missing}") from missing
    raise ValueError(text)


class Solution:
    """What a picture needs of a specification."""

    def __init__(self, path):
        spec = tomllib.loads(path.read_text())
        self.name, self.title = spec["name"], spec["title"]
        self.dimension, self.coordinates = spec["dimension"], spec["coordinates"]
        self.law = spec["material"].get("law", "")
        self.names = {name: own["default"] for name, own in spec["parameters"].items()}
        for name, text in spec.get("let", {}).items():
            try:
                self.names[name] = value(text, self.names)
            except (ValueError, TypeError):
                pass  # it contains the time or a place
        self.domain = spec["domain"]
        self.period = value(spec["time"]["period"], self.names)

    def of(self, text):
        return value(text, self.names)

    def points(self):
        """Reference positions in the names of `mms eval`, of which each is a dot."""
        shape = self.domain["shape"]
        if shape == "annulus":
            inner, outer = self.of(self.domain["inner"]), self.of(self.domain["outer"])
            rows = max(3, round(7 * (outer - inner) / outer))
            found = []
            for row in range(rows):
                radius = inner + (outer - inner) * (row + 0.5) / rows
                count = round(2 * math.pi * radius / ((outer - inner) / rows))
                angles = [2 * math.pi * (k + 0.5) / count for k in range(count)]
                found += [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
            return found
        if shape == "shell":
            inner, outer = self.of(self.domain["inner"]), self.of(self.domain["outer"])
            # A section through the axis.
            found = []
            for row in range(6):
                radius = inner + (outer - inner) * (row + 0.5) / 6
                count = round(math.pi / 2 * radius / ((outer - inner) / 6))
                angles = [math.pi / 2 * (k + 0.5) / count for k in range(count)]
                found += [(radius * math.sin(a), 0.0, radius * math.cos(a)) for a in angles]
            return found
        if shape == "solid-cylinder":
            lower, upper = [0.0, self.of(self.domain["lower"])], [self.of(self.domain["outer"]), self.of(self.domain["upper"])]
        else:
            lower, upper = ([self.of(x) for x in self.domain[end]] for end in ("lower", "upper"))
        if self.dimension == 1:
            return [(lower[0] + (upper[0] - lower[0]) * (i + 0.5) / 24,) for i in range(24)]
        length = max(high - low for low, high in zip(lower, upper))
        across = 10 if self.dimension == 2 else 7
        counts = [max(1, round(across * (high - low) / length)) for low, high in zip(lower, upper)]
        at = [[low + (high - low) * (i + 0.5) / n for i in range(n)] for low, high, n in zip(lower, upper, counts)]
        if self.dimension == 2:
            return [(x, y) for y in at[1] for x in at[0]]
        # The three faces that are seen.
        faces = [(x, lower[1], z) for z in at[2] for x in at[0]]
        faces += [(upper[0], y, z) for z in at[2] for y in at[1]]
        return faces + [(x, y, upper[2]) for y in reversed(at[1]) for x in at[0]]

    def seen(self, at):
        """A place in the plane of the picture."""
        if len(at) == 1:
            return (at[0], 0.0)
        if len(at) == 2 or self.coordinates == "axisymmetric":
            return (at[0], at[-1])
        if self.domain["shape"] == "shell":
            return (at[0], at[2])
        return (at[0] + 0.5 * at[1], at[2] + 0.35 * at[1])

    def frames(self, program):
        """For each frame the places and sizes of stress."""
        points = self.points()
        names = ["R", "Z"] if self.coordinates == "axisymmetric" else ["X", "Y", "Z"][: self.dimension]
        lines = [",".join([*names, "t"])]
        for frame in range(FRAMES):
            time = self.period * frame / FRAMES
            lines += [",".join(repr(x) for x in (*point, time)) for point in points]
        rows = json.loads(mms(program, "eval", self.name, "--points", "-", "--json", "-", stdin="\n".join(lines) + "\n"))["rows"]
        found = []
        for frame in range(FRAMES):
            own = rows[frame * len(points) : (frame + 1) * len(points)]
            places = []
            for point, row in zip(points, own):
                u = [row["u"][0], row["u"][2]] if self.coordinates == "axisymmetric" and len(row["u"]) == 3 else row["u"]
                places.append(self.seen([x + d for x, d in zip(point, u)]))
            stress = [math.sqrt(sum(entry**2 for line in row["P"] for entry in line)) for row in own]
            found.append((places, stress))
        return found


def short(number):
    """A number of two digits for people."""
    if number == 0:
        return "0"
    power = math.floor(math.log10(abs(number)))
    digits = round(number / 10.0 ** (power - 1))
    rounded = digits * 10.0 ** (power - 1)
    return f"{rounded:.0f}" if 1 <= power < 5 else (f"{rounded:.2g}" if -3 < power < 1 else f"{rounded:.1e}")


def animated(solution, program):
    """A motion over a period, its dots coloured by the size of the first Piola-Kirchhoff stress."""
    frames = solution.frames(program)
    xs = [x for places, _ in frames for x, _ in places]
    ys = [y for places, _ in frames for _, y in places]
    extent = max(max(xs) - min(xs), max(ys) - min(ys))
    scale = (SIDE - 2 * EDGE) / extent
    middle = ((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2)
    most = max(max(stress) for _, stress in frames)
    count = len(frames[0][0])
    area = 1.0 if solution.dimension == 1 else (max(xs) - min(xs)) * (max(ys) - min(ys))
    radius = (SIDE - 2 * EDGE) / 24 / 2 if solution.dimension == 1 else 0.5 * scale * math.sqrt(area / count)
    radius = min(radius, 6.5) * 0.95
    high = 60 if solution.dimension == 1 else SIDE
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIDE} {high + 34}" width="{SIDE}" height="{high + 34}" role="img" font-family="sans-serif" font-size="11" fill="#111">',
        f"<title>{solution.name}: {solution.title}</title>",
        f"<desc>{count} particles over a period, coloured by the size of the first Piola-Kirchhoff stress, 0 to {short(most)}; light is high.</desc>",
        f"<style>.f{{visibility:hidden;animation:a {SECONDS}s step-end infinite}}"
        f"@keyframes a{{0%{{visibility:visible}}{100 / FRAMES:.3f}%{{visibility:hidden}}}}"
        + "".join(f".f{i}{{animation-delay:{SECONDS * i / FRAMES:.3f}s}}" for i in range(1, FRAMES))
        + "@media (prefers-reduced-motion:reduce){.f{animation:none}.f0{visibility:visible}}"
        + "@media print{.f{animation:none}.f0{visibility:visible}}</style>",
        f'<rect width="{SIDE}" height="{high + 34}" fill="#fff"/><rect width="{SIDE}" height="{high}" fill="#d8d8d8"/>',
        f'<g fill="none" stroke-linecap="round" stroke-width="{8 * radius:.1f}" transform="scale(.25)">',
    ]
    for index, (places, stress) in enumerate(frames):
        bands = [""] * len(COLOURS)
        for (x, y), size in zip(places, stress):
            band = min(int(size / most * len(COLOURS)), len(COLOURS) - 1) if most > 0 else 0
            px, py = SIDE / 2 + scale * (x - middle[0]), high / 2 - scale * (y - middle[1])
            bands[band] += f"M{4 * px:.0f} {4 * py:.0f}h0"
        paths = "".join(f'<path d="{d}" stroke="{c}"/>' for c, d in zip(COLOURS, bands) if d)
        out.append(f'<g class="f f{index}">{paths}</g>')
    out.append("</g>")
    width = 90 / len(COLOURS)
    out += [f'<rect x="{45 + i * width:.0f}" y="{high + 6}" width="{width:.0f}" height="9" fill="{c}"/>' for i, c in enumerate(COLOURS)]
    out.append(f'<text x="40" y="{high + 15}" text-anchor="end">0</text><text x="140" y="{high + 15}">{short(most)}</text>')
    out.append(f'<text x="{SIDE / 2:.0f}" y="{high + 29}" text-anchor="middle" font-size="10">size of P [Pa]</text></svg>')
    return "\n".join(out) + "\n"


def gallery(program):
    files, groups = {}, {}
    names = [row["name"] for row in json.loads(mms(program, "list", "--json", "-"))["rows"]]
    specs = {path.stem: path for path in (REPOSITORY / "mms-specs").rglob("*.toml")}
    for name in names:
        solution = Solution(specs[name])
        files[OUT / "gallery" / f"{name}.svg"] = animated(solution, program)
        folder = specs[name].parent.name
        groups.setdefault("" if folder == "mms-specs" else folder, []).append(solution)
    titles = {
        "": "Elastic bodies",
        "with-memory": "Materials with memory, and bodies that change from place to place",
        "incompressible": "Motions that keep the volume",
        "revolution": "Bodies of revolution",
    }
    page = [
        "# Gallery",
        "",
        "Each picture shows the exact motion of a solution of the library over one period, in slow motion: particles at their exact positions, by `mms eval`, coloured",
        "by the size of the first Piola-Kirchhoff stress (Frobenius norm). Light is high, as in viridis; each picture has its own bar. Of bodies in space the faces that",
        "are seen are drawn, of the shell a section, of bodies of revolution the half plane of `R` and `Z`. `mms explain NAME` tells what a solution can and cannot find,",
        "and `mms run NAME --picture FILE.svg` draws the particles of a run. [The library](library.md) has orders of each.",
        "",
        "`python docs/pictures.py MMS` writes this page and its pictures.",
    ]
    for group, title in titles.items():
        page += ["", f"## {title}", "", '<div class="gallery">', ""]
        for solution in groups.pop(group, []):
            page += [
                f'<figure><img src="../pictures/gallery/{solution.name}.svg" alt="{solution.title}: particles in motion over a period" loading="lazy">'
                f"<figcaption><code>{solution.name}</code><br>{solution.title}, {solution.dimension}D, {solution.law}</figcaption></figure>",
            ]
        page += ["", "</div>"]
    if groups:
        sys.exit(f"docs/pictures.py: folders of mms-specs without a heading: {', '.join(groups)}")
    files[PAGE] = "\n".join(page) + "\n"
    return files


# --- pictures of the method ----------------------------------------------------------------------


def head(width, height, title, description):
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" role="img" font-family="sans-serif" font-size="14" fill="#111">\n'
        f'<title>{title}</title>\n<desc>{description}</desc>\n<rect width="{width}" height="{height}" fill="#fff"/>\n'
    )


def step():
    """P2G, grid update and G2P side by side."""
    side, cells, gap = 210, 3, 30
    cell = side / cells
    width, height = 3 * side + 4 * gap, side + 104
    # Particles in the two lower left cells, moved off the lattice.
    particles = [(0.45, 0.55), (0.8, 0.4), (0.5, 1.25), (0.95, 1.1), (1.35, 0.6), (1.75, 0.7), (1.3, 1.4), (1.7, 1.5), (2.3, 0.8), (2.4, 1.45)]
    chosen = (1.35, 0.6)
    out = head(width, height, "One step", "Left: particles give mass, momentum and force to the nodes of their cells. Middle: nodes divide by their mass, and advance. Right: particles take velocity and velocity gradient from the nodes, and move.")
    out += '<defs><marker id="m" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" markerHeight="6" orient="auto-start-reverse"><path d="M0 0L8 4L0 8z" fill="context-stroke"/></marker></defs>\n'
    captions = [
        ("1. P2G: particles to grid", "sums of mass, momentum", "and force at each node"),
        ("2. Grid update", "force over mass; velocity", "advances; walls are held"),
        ("3. G2P: grid to particles", "velocity and F follow the grid;", "particles move, the grid is reset"),
    ]
    for panel, (title, first, second) in enumerate(captions):
        x0, y0 = gap + panel * (side + gap), 44
        place = lambda x, y: (x0 + x * cell, y0 + side - y * cell)
        out += f'<text x="{x0}" y="26" font-size="15" font-weight="bold">{title}</text>\n'
        grid = "".join(f"M{x0} {y0 + i * cell:.0f}h{side}M{x0 + i * cell:.0f} {y0}v{side}" for i in range(cells + 1))
        out += f'<path d="{grid}" stroke="#bbb" fill="none"/>\n'
        for x, y in particles:
            px, py = place(x, y)
            if panel == 2:
                px, py = px + 12, py - 9
            faint = panel == 1
            out += f'<circle cx="{px:.0f}" cy="{py:.0f}" r="6" fill="{"#e4e4e4" if faint else "#31688e" if (x, y) != chosen else "#b5500b"}"/>\n'
        corners = [(1, 0), (2, 0), (1, 1), (2, 1)]
        if panel != 1:
            px, py = place(*chosen)
            for corner in corners:
                nx, ny = place(*corner)
                # From rim to rim.
                dx, dy = nx - px, ny - py
                length = math.hypot(dx, dy)
                ends = [(px + dx * 9 / length, py + dy * 9 / length), (nx - dx * 8 / length, ny - dy * 8 / length)]
                (ax, ay), (bx, by) = ends if panel == 0 else reversed(ends)
                out += f'<path d="M{ax:.1f} {ay:.1f}L{bx:.1f} {by:.1f}" stroke="#b5500b" stroke-width="1.8" marker-end="url(#m)"/>\n'
        for i in range(cells + 1):
            for j in range(cells + 1):
                nx, ny = place(i, j)
                active = j <= 2
                out += f'<rect x="{nx - 4:.0f}" y="{ny - 4:.0f}" width="8" height="8" fill="{"#111" if active else "#fff"}" stroke="#111"/>\n'
                if panel == 1 and active:
                    wall = i == 0
                    dx, dy = (0 if wall else 24), (-16 if j else 0)
                    if dx or dy:
                        out += f'<path d="M{nx:.0f} {ny:.0f}l{dx} {dy}" stroke="#1f7a5a" stroke-width="2.2" marker-end="url(#m)"/>\n'
        if panel == 2:
            px, py = place(*chosen)
            out += f'<circle cx="{px:.0f}" cy="{py:.0f}" r="6" fill="none" stroke="#b5500b" stroke-dasharray="2 2"/>\n'
        out += f'<text x="{x0}" y="{y0 + side + 26}">{first}</text><text x="{x0}" y="{y0 + side + 46}">{second}</text>\n'
    return out + "</svg>\n"


def hat(x):
    return max(0.0, 1 - abs(x))


def bspline2(x):
    x = abs(x)
    return 0.75 - x * x if x < 0.5 else (0.5 * (1.5 - x) ** 2 if x < 1.5 else 0.0)


def bspline3(x):
    x = abs(x)
    return (4 - 6 * x * x + 3 * x**3) / 6 if x < 1 else ((2 - x) ** 3 / 6 if x < 2 else 0.0)


def mean(function, half):
    """The mean of a function over a particle's box, as the weights of GIMP are."""
    n = 200
    return lambda x: sum(function(x + half * (2 * (k + 0.5) / n - 1)) for k in range(n)) / n


SHAPES = [
    ("linear", hat, "#555"),
    ("gimp", mean(hat, 0.25), "#0072b2"),
    ("bspline2", bspline2, "#d55e00"),
    ("gimp-bspline2", mean(bspline2, 0.25), "#009e73"),
    ("bspline3", bspline3, "#a0428b"),
]


def shapes():
    """Weights and gradients of one node against the place of the particle."""
    width, height, side, high = 740, 330, 300, 210
    out = head(width, height, "Shape functions", "Weight and gradient of a node against the distance of the particle in cells, for five shape functions. The gradient of linear jumps at the node; that of gimp has kinks; that of the splines is smooth.")
    for panel, (title, low, top) in enumerate([("weight S", 0.0, 1.0), ("gradient G, times h", -1.05, 1.05)]):
        x0, y0 = 52 + panel * (side + 62), 40
        px = lambda x: x0 + (x + 2) / 4 * side
        py = lambda y: y0 + (top - y) / (top - low) * high
        out += f'<text x="{x0}" y="26" font-size="15" font-weight="bold">{title}</text><rect x="{x0}" y="{y0}" width="{side}" height="{high}" fill="none" stroke="#444"/>\n'
        out += "".join(f'<path d="M{px(t):.0f} {y0}v{high}" stroke="#e4e4e4"/><text x="{px(t):.0f}" y="{y0 + high + 18}" text-anchor="middle">{t}</text>\n' for t in (-2, -1, 0, 1, 2))
        for tick in (0, 0.5, 1) if panel == 0 else (-1, 0, 1):
            out += f'<path d="M{x0} {py(tick):.0f}h{side}" stroke="#e4e4e4"/><text x="{x0 - 6}" y="{py(tick) + 5:.0f}" text-anchor="end">{tick}</text>\n'
        for name, function, colour in SHAPES:
            places = [-2 + 4 * i / 160 for i in range(161)]
            if panel == 0:
                values = [function(x) for x in places]
            else:
                d = 1e-6
                values = [(function(x + d) - function(x - d)) / (2 * d) for x in places]
                if name == "linear":
                    places = [-2, -1, -1, 0, 0, 1, 1, 2]
                    values = [0, 0, 1, 1, -1, -1, 0, 0]
            path = "".join(f"{'L' if i else 'M'}{px(x):.1f} {py(y):.1f}" for i, (x, y) in enumerate(zip(places, values)))
            dash = ' stroke-dasharray="6 4"' if name.startswith("gimp") else ""
            out += f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>\n'
        out += f'<text x="{x0 + side / 2}" y="{y0 + high + 38}" text-anchor="middle">distance of particle and node, in cells</text>\n'
    x = 60
    for name, _, colour in SHAPES:
        dash = ' stroke-dasharray="6 4"' if name.startswith("gimp") else ""
        out += f'<path d="M{x} 314h26" stroke="{colour}" stroke-width="2"{dash}/><text x="{x + 32}" y="319">{name}</text>\n'
        x += 62 + 8 * len(name)
    return out + "</svg>\n"


def beside(pictures, title, description):
    """Pictures that mms drew, side by side."""
    x, out, tall = 0.0, "", 0.0
    for picture in pictures:
        width, height = map(float, re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', picture).groups())
        inner = re.sub(r"<svg [^>]*>", f'<svg x="{x}" y="0" width="{width}" height="{height}" viewBox="0 0 {width} {height}">', picture, count=1)
        out += re.sub(r"<title>.*?</title>|<desc>.*?</desc>", "", inner, flags=re.S)
        x, tall = x + width, max(tall, height)
    return head(f"{x:g}", f"{tall:g}", title, description) + out + "</svg>\n"


def drawn(program):
    """Plots of mms itself."""
    with tempfile.TemporaryDirectory() as folder:
        def plot(option, *arguments):
            path = Path(folder) / "plot.svg"
            mms(program, *arguments, option, str(path), "--quiet")
            return path.read_text()

        run = ["run", "ring", "--cells", "8", "--periods", "0.02", "--at", "0", "--layout"]
        layouts = [plot("--picture", *run, layout, "--shape", shape) for layout, shape in (("lattice", "gimp"), ("body-fitted", "cpdi2"), ("clipped", "cpdi2"))]
        return {
            "layouts.svg": beside(layouts, "Layouts", "The same ring as a lattice, whose rims are stair steps; fitted to the body, in rings; and as a lattice clipped with the rims."),
            "orders.svg": beside(
                [
                    plot("--plot", "converge", "axis-aligned", "--cells", "8,16,32,64", "--periods", "0.5", "--integrator", integrator, "--shape", "gimp")
                    for integrator in ("cd", "usl")
                ],
                "Orders",
                "Errors of the axis-aligned problem against the grid spacing, with cd on the left, whose order is 2, and with usl on the right, whose order falls.",
            ),
            "stability.svg": plot("--plot", "stability", "axis-aligned", "--cells", "8", "--over", "amplitude=0.02,0.05,0.1,0.2", "--over", "nu=0,0.2,0.3,0.4,0.45"),
        }


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("mms", metavar="MMS", help="the program mms")
    arguments.add_argument("--check", action="store_true", help="write nothing, and fail where a file differs")
    asked = arguments.parse_args()
    program = str(Path(asked.mms).resolve())
    files = gallery(program)
    files |= {OUT / "step.svg": step(), OUT / "shapes.svg": shapes()}
    files |= {OUT / name: text for name, text in drawn(program).items()}
    stale = [path for path, text in files.items() if not path.exists() or path.read_text() != text]
    if asked.check:
        for path in stale:
            print(f"{path.relative_to(REPOSITORY)} is not what docs/pictures.py draws; write it with python docs/pictures.py MMS")
        sys.exit(bool(stale))
    for path in stale:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text := files[path])
        print(f"{path.relative_to(REPOSITORY)}: {len(text)} bytes")


if __name__ == "__main__":
    main()

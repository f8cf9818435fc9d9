"""HTML page of a scene and its film, with a clock, read-outs, a legend and a time bar over it."""

import dataclasses as dc
import html
from pathlib import Path

import numpy as np
from jinja2 import Environment, StrictUndefined
from pydrake.geometry import Meshcat, Rgba

from diagrams.loop.replay.film import FRAME_RATE
from diagrams.loop.replay.scene import SIDES
from np_drake.files.atomic_file import write_text

TEMPLATE = Path(__file__).with_name("over.html.j2")
# A browser then refuses every address: what the page needs is in it.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src data: blob:; font-src data:; worker-src blob:"
)


@dc.dataclass(frozen=True)
class ReadOut:
    """Position error that is shown as a number and as a curve: values (frames,) [m]; infinite where
    lost.
    """

    label: str
    color: Rgba
    values: np.ndarray


@dc.dataclass(frozen=True)
class Trail:
    """Trail that grows: in frame k, points `first[k]` to `last[k]` of the tube at `path` are
    seen.
    """

    path: str
    first: np.ndarray
    last: np.ndarray


@dc.dataclass(frozen=True)
class Page:
    """What stands over the scene.

    start: the clock's time in the first frame [s].
    legend: (colour, text).
    follow: path of the object with which the camera flies, and where from it the camera is [m].
    """

    title: str
    start: float
    read_outs: tuple[ReadOut, ...]
    trails: tuple[Trail, ...] = ()
    legend: tuple[tuple[Rgba, str], ...] = ()
    note: str = ""
    follow: tuple[str, tuple[float, float, float]] | None = None

    def numbers(self) -> dict:
        """Return the numbers of the page: errors in cm, trails in indices of their triangles."""
        return {
            "start": self.start,
            "rate": FRAME_RATE,
            "follow": self.follow and {"path": _scene(self.follow[0]), "eye": list(self.follow[1])},
            "errors": [
                {"label": r.label, "color": _css(r.color), "cm": [_cm(value) for value in r.values]}
                for r in self.read_outs
            ],
            "trails": [
                {
                    "path": _scene(t.path),
                    "first": (6 * SIDES * t.first).tolist(),
                    "last": (6 * SIDES * t.last).tolist(),
                }
                for t in self.trails
            ],
        }

    def over(self) -> str:
        """Return the HTML that stands over the scene."""
        template = Environment(autoescape=True, undefined=StrictUndefined).from_string(
            TEMPLATE.read_text("utf-8")
        )
        legend = [(_css(color), text) for color, text in self.legend]
        return template.render(
            title=self.title, note=self.note, legend=legend, numbers=self.numbers()
        )


def write_page(meshcat: Meshcat, page: Page, path: str | Path) -> None:
    """Write the scene with its film as one HTML file.
    Raises: OSError: if it cannot be written.
    """
    head, rest = meshcat.StaticHtml().split("<title>Drake MeshCat</title>", 1)
    body, end = rest.rsplit("</body>", 1)
    policy = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    screen = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    title = f"{screen}{policy}<title>{html.escape(page.title)}</title>"
    write_text(path, f"{head}{title}{body}{page.over()}</body>{end}")


def _cm(value: float) -> float | None:
    return round(100 * float(value), 2) if np.isfinite(value) else None


def _scene(path: str) -> list[str]:
    return ["drake", *path.split("/")]


def _css(color: Rgba) -> str:
    red, green, blue = (round(255 * c) for c in (color.r(), color.g(), color.b()))
    return f"rgb({red},{green},{blue})"

"""Writes docs/figures/loop.svg: the closed loop of a flight, from Drake's own GetGraphvizString.

Needs Graphviz's `dot` (Debian: apt install graphviz). Usage: python docs/make_architecture.py
"""

import re
import subprocess
from pathlib import Path

from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_diagram import make_flight_diagram

FILE = Path(__file__).parent / "figures" / "loop.svg"
NODE = re.compile(r"^(s\d+) \[.*?^>\];\n", re.M | re.S)


def loop_graph() -> str:
    """Return the loop in Graphviz's language, without the recorder and what is behind it."""
    config = load_experiment("circle")
    config.controller.kind = "np"
    config.controller.predictor = str(NP_MODEL)
    text = make_flight_diagram(config).GetGraphvizString(max_depth=1)
    for node in [node for node in NODE.finditer(text) if "name=record" in node[0]]:
        text = text.replace(node[0], "")
        text = re.sub(rf"^{node[1]}:.*\n|^.*-> {node[1]}:.*\n", "", text, flags=re.M)
    text = re.sub(r"<B>systems\.\w+\.(\w+)</B>", r"<B>\1</B>", text)  # the class without its module
    text = re.sub(r"digraph _\d+ \{", "digraph loop {", text)
    return text.replace(
        "rankdir=LR",
        'rankdir=LR ranksep=1.1 nodesep=0.4 bgcolor=white\nnode [fontname="sans-serif"]',
    )


if __name__ == "__main__":
    svg = subprocess.run(
        ["dot", "-Tsvg"], input=loop_graph(), capture_output=True, text=True, check=True
    ).stdout
    FILE.write_text(svg)

"""Draws monitor.svg: the screen of `rigctl monitor` in a terminal of 80 by 24, after homing and during a move.

    cargo xtask build && cargo xtask firmware
    python3 docs/figures/monitor.py

It runs the monitor on the emulated board, in real time, and presses the keys of KEYS. Another `rigctl` can be named as
the argument. Needs Python 3.11 on Linux or macOS and nothing else.
"""

import codecs
import fcntl
import os
import pty
import re
import select
import struct
import sys
import termios
import time
from html import escape
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COLUMNS, LINES = 80, 24
# Seconds and keys: home; ask for a position, 8 mm.
KEYS = [(4.0, b"h"), (40.0, b"m"), (40.5, b"8\r")]
PICTURE_S = 43.0
COLOURS = {"1": "#b3261e", "2": "#1b6e3c", "3": "#b35900", "4": "#2a5a9e", "5": "#7a3b8f", "6": "#2a5a9e"}
PLAIN = ("#111", False)
Cell = tuple[str, tuple[str, bool]]


class Screen:
    """The few controls of a terminal that the monitor uses: cursor, erase, colour, bold."""

    def __init__(self) -> None:
        self.cells: list[list[Cell]] = [[(" ", PLAIN)] * COLUMNS for _ in range(LINES)]
        self.line, self.column, self.style, self.rest = 0, 0, PLAIN, ""

    def feed(self, text: str) -> None:
        text = self.rest + text
        # A sequence that is not complete yet waits for the rest.
        cut = re.search(r"\x1b(\[[0-9;?]*)?$", text)
        text, self.rest = (text[: cut.start()], text[cut.start() :]) if cut else (text, "")
        for sequence, char in re.findall(r"(\x1b\[[0-9;?]*[A-Za-z])|([^\x1b])", text, re.S):
            self.control(sequence[2:-1], sequence[-1]) if sequence else self.put(char)

    def put(self, char: str) -> None:
        if char == "\r":
            self.column = 0
        elif char == "\n":
            self.line = min(self.line + 1, LINES - 1)
        elif self.column < COLUMNS:
            self.cells[self.line][self.column] = (char, self.style)
            self.column += 1

    def control(self, numbers: str, kind: str) -> None:
        values = numbers.split(";")
        if kind == "H":
            line, column = ([int(value or 1) for value in values] + [1, 1])[:2]
            self.line, self.column = line - 1, column - 1
        elif kind == "J" or (kind == "h" and numbers == "?1049"):
            self.cells = [[(" ", PLAIN)] * COLUMNS for _ in range(LINES)]
        elif kind == "m":
            self.colour(values)

    def colour(self, values: list[str]) -> None:
        colour, bold = self.style
        k = 0
        while k < len(values):
            match values[k]:
                case "" | "0":
                    colour, bold = PLAIN
                case "1":
                    bold = True
                case "22":
                    bold = False
                case "39":
                    colour = PLAIN[0]
                case "38" | "48" if values[k + 1 : k + 2] == ["5"]:
                    if values[k] == "38":
                        colour = COLOURS.get(values[k + 2], PLAIN[0])
                    k += 2
                case value if len(value) == 2 and value[0] == "3":
                    colour = COLOURS.get(value[1], PLAIN[0])
            k += 1
        self.style = (colour, bold)


def run(rigctl: str) -> Screen:
    """The screen at PICTURE_S."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(ROOT)
        os.environ["TERM"] = "xterm-256color"
        os.execv(rigctl, [rigctl, "monitor"])
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
    screen, keys, start = Screen(), list(KEYS), time.monotonic()
    # A character of several bytes may come in two parts.
    decoder = codecs.getincrementaldecoder("utf-8")()
    while time.monotonic() - start < PICTURE_S:
        if select.select([terminal], [], [], 0.05)[0]:
            screen.feed(decoder.decode(os.read(terminal, 65536)))
        while keys and time.monotonic() - start > keys[0][0]:
            os.write(terminal, keys.pop(0)[1])
    os.write(terminal, b"q")
    time.sleep(2)
    os.close(terminal)
    os.waitpid(child, 0)
    return screen


def main() -> None:
    screen = run(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/rigctl"))
    advance, height, left, top = 12.04, 24, 20, 96
    width, tall = round(2 * left + COLUMNS * advance), top + LINES * height + 4
    title = "rigctl monitor: an 8 mm move after homing"
    svg = f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {tall}" width="{width}" height="{tall}" role="img">
<title>{title}</title>
<desc>The terminal of 80 by 24 characters: state, position, load and their history.</desc>
<style>text{{font:20px "DejaVu Sans Mono",Menlo,Consolas,monospace;fill:#111}}.h{{font:bold 20px "DejaVu Sans",Verdana,sans-serif}}.n{{font:16px "DejaVu Sans",Verdana,sans-serif;fill:#555}}</style>
<rect width="{width}" height="{tall}" fill="#fff"/>
<text x="{left}" y="34" class="h">{title}</text>
<text x="{left}" y="60" class="n">Emulated board and plant (nominal, seed 1); terminal of {COLUMNS} × {LINES}</text>
"""
    for number, line in enumerate(screen.cells):
        # Words of one style, each at its place, so that no font can shift what follows.
        for style, cells in groupby(enumerate(line), lambda cell: cell[1][0] != " " and cell[1][1]):
            if not style:
                continue
            first, text = (found := list(cells))[0][0], "".join(char for _, (char, _) in found)
            weight = ' font-weight="bold"' if style[1] else ""
            svg += (
                f'<text x="{left + first * advance:.1f}" y="{top + number * height}" textLength="{len(text) * advance:.1f}" '
                f'lengthAdjust="spacingAndGlyphs" style="fill:{style[0]}"{weight}>{escape(text)}</text>\n'
            )
    Path(__file__).with_name("monitor.svg").write_text(svg + "</svg>\n")


if __name__ == "__main__":
    main()

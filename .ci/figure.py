"""Figures of curves as SVG, with the standard library alone: axes with units, ticks, lines and markers."""

import math
from xml.sax.saxutils import escape

COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"]
MARKERS = ["circle", "square", "triangle", "diamond"]
FONT = "font-family='Helvetica, Arial, sans-serif'"

WIDTH, HEIGHT = 460, 330
LEFT, RIGHT, TOP, BOTTOM = 84, 18, 14, 52
LEGEND_LINE = 22

# A series with more points than this is a line without markers.
MOST_MARKERS = 45


def ticks(low, high, count=7):
    """Round numbers between low and high, at 1, 2 or 5 times a power of ten."""
    raw = (high - low) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= raw * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [i * step for i in range(first, last + 1)], step


def label(value, step):
    """A tick's number, with as many digits as the step needs."""
    if value == 0:
        return "0"
    if abs(value) >= 1e5 or step < 1e-3:
        exponent = math.floor(math.log10(abs(value)) + 1e-9)
        digits = max(0, exponent - math.floor(math.log10(step) + 1e-9))
        return f"{value / 10.0**exponent:.{digits}f}e{exponent}".replace("-", "−")
    return f"{value:.{max(0, -math.floor(math.log10(step) + 1e-9))}f}".replace("-", "−")


def text(x, y, words, anchor="middle", size=14, turned=False):
    turn = f" transform='rotate(-90 {x:.1f} {y:.1f})'" if turned else ""
    return f"<text x='{x:.1f}' y='{y:.1f}' text-anchor='{anchor}' font-size='{size}'{turn}>{escape(words)}</text>"


def marker(kind, x, y, color, r=4.0):
    style = f"fill='white' fill-opacity='0.6' stroke='{color}' stroke-width='1.6'"
    if kind == "circle":
        return f"<circle cx='{x:.2f}' cy='{y:.2f}' r='{r}' {style}/>"
    corners = {
        "square": [(-1, -1), (1, -1), (1, 1), (-1, 1)],
        "triangle": [(0, -1.3), (1.2, 0.9), (-1.2, 0.9)],
        "diamond": [(0, -1.4), (1.4, 0), (0, 1.4), (-1.4, 0)],
    }[kind]
    return "<polygon points='" + " ".join(f"{x + r * a:.2f},{y + r * b:.2f}" for a, b in corners) + f"' {style}/>"


def limits(values, room=0.05):
    low, high = min(values), max(values)
    if high - low < 1e-12 * max(abs(low), abs(high), 1e-300):
        low, high = low - 0.5 * (abs(low) or 1), high + 0.5 * (abs(high) or 1)
    return low - room * (high - low), high + room * (high - low)


class Panel:
    """One pair of axes. `known` is a list of (x, y), `series` a list of such lists with their places in the legend. `whole`: x has whole numbers."""

    def __init__(self, x_name, y_name, known, series, whole=False):
        self.names, self.known, self.series, self.whole = (x_name, y_name), known, series, whole
        points = known + [point for _, line in series for point in line]
        self.x, self.y = limits([x for x, _ in points], 0.02), limits([y for _, y in points])

    def place(self, point):
        (x0, x1), (y0, y1) = self.x, self.y
        x = LEFT + (point[0] - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT)
        return x, HEIGHT - BOTTOM - (point[1] - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM)

    def line(self, points, style):
        if not points:
            return ""
        path = " ".join(f"{x:.2f},{y:.2f}" for x, y in map(self.place, points))
        return f"<polyline points='{path}' fill='none' {style}/>"

    @staticmethod
    def marked(points):
        return 0 < len(points) <= MOST_MARKERS

    def axes(self):
        right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
        parts = [f"<rect x='{LEFT}' y='{TOP}' width='{right - LEFT}' height='{bottom - TOP}' fill='none' stroke='black'/>"]
        values, step = ticks(*self.x)
        if self.whole:
            values, step = [value for value in values if abs(value - round(value)) < 1e-9], max(step, 1)
        for value in values:
            x, _ = self.place((value, self.y[0]))
            parts.append(f"<path d='M{x:.2f} {bottom}v-5' stroke='black'/>" + text(x, bottom + 18, label(value, step), size=13))
        values, step = ticks(*self.y)
        for value in values:
            _, y = self.place((self.x[0], value))
            parts.append(f"<path d='M{LEFT} {y:.2f}h5' stroke='black'/>" + text(LEFT - 6, y + 4.5, label(value, step), "end", 13))
        parts.append(text((LEFT + right) / 2, HEIGHT - 12, self.names[0]))
        parts.append(text(18, (TOP + bottom) / 2, self.names[1], turned=True))
        return parts

    def draw(self):
        parts = [self.line(self.known, "stroke='#b8b8b8' stroke-width='5' stroke-linejoin='round'")]
        for place, points in self.series:
            color, kind = COLORS[place % len(COLORS)], MARKERS[place % len(MARKERS)]
            if self.marked(points):
                parts.append(self.line(points, f"stroke='{color}' stroke-width='1' stroke-opacity='0.5'"))
                parts += [marker(kind, *self.place(point), color) for point in points]
            else:
                parts.append(self.line(points, f"stroke='{color}' stroke-width='1.5' stroke-linejoin='round'"))
        return parts + self.axes()


def legend(entries, width, known, marked):
    """Lines of the legend above the panels, and their height. `marked` says whether curves have markers."""
    entries = ([(None, known)] if known else []) + list(enumerate(entries))
    parts, x, y = [], 12.0, 16.0
    for place, words in entries:
        length = 44 + 7.6 * len(words)
        if x + length > width and x > 12:
            x, y = 12.0, y + LEGEND_LINE
        color = "#b8b8b8" if place is None else COLORS[place % len(COLORS)]
        thick = 5 if place is None else 1.5
        parts.append(f"<path d='M{x:.1f} {y:.1f}h26' stroke='{color}' stroke-width='{thick}'/>")
        if place is not None and marked:
            parts.append(marker(MARKERS[place % len(MARKERS)], x + 13, y, color))
        parts.append(text(x + 32, y + 4.5, words, "start", 13))
        x += length
    return parts, y + LEGEND_LINE - 8


def figure(panels, entries, known=None):
    """Panels side by side, at most two in a row, below one legend."""
    columns = min(2, len(panels))
    width = columns * WIDTH
    marked = any(panel.marked(points) for panel in panels for _, points in panel.series)
    parts, above = legend(entries, width, known, marked)
    height = above + HEIGHT * ((len(panels) + columns - 1) // columns)
    for i, panel in enumerate(panels):
        x, y = WIDTH * (i % columns), above + HEIGHT * (i // columns)
        parts.append(f"<g transform='translate({x} {y:.0f})'>" + "\n".join(panel.draw()) + "</g>")
    head = f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height:.0f}' viewBox='0 0 {width} {height:.0f}' {FONT}>"
    return "\n".join([head, f"<rect width='{width}' height='{height:.0f}' fill='white'/>", *parts, "</svg>", ""])

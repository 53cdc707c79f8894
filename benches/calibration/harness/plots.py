"""Plots as SVG, without a library: the error by the number of rows, and its coverage."""

from __future__ import annotations

import html
import math

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>A benchmark of calibration</title>
<style>
body { font: 15px/1.4 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff }
table { border-collapse: collapse; margin: 0.5rem 0 1.5rem; font-variant-numeric: tabular-nums; display: block; overflow-x: auto }
td, th { padding: 0.15rem 0.6rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap } td:first-child, th:first-child { text-align: left }
svg text { font: 12px system-ui, sans-serif; fill: #222 }
</style>
<h1>A benchmark of calibration</h1>
BODY
</html>
"""
# Okabe and Ito: told apart with every kind of colour vision.
COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#cc79a7", "#f0e442", "#d55e00", "#e69f00", "#000000", "#777777", "#aaaaaa")
WIDTH, HEIGHT, LEFT, BOTTOM, TOP, LEGEND = 820, 330, 55, 40, 12, 210


def errors(name: str, tasks: list[str], names: list[str], cells) -> str:
    """Mean error over rows, both by their logarithms; the last place is that of all rows."""
    lines = {
        who: [(k, cells[(name, task, who)].mean_mm) for k, task in enumerate(tasks)
              if (name, task, who) in cells and cells[(name, task, who)].mean_mm is not None]
        for who in names
    }
    every = [math.log10(y) for points in lines.values() for _, y in points]
    if not every:
        return ""
    low, high = min(every) - 0.03, max(every) + 0.03
    x = lambda k: LEFT + (WIDTH - LEFT - LEGEND) * k / max(len(tasks) - 1, 1)
    y = lambda mm: TOP + (HEIGHT - TOP - BOTTOM) * (high - math.log10(mm)) / (high - low)
    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" aria-label="Error by rows, {html.escape(name)}">']
    for mm in ticks(low, high):
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - LEGEND}" y1="{y(mm):.1f}" y2="{y(mm):.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y(mm) + 4:.1f}" text-anchor="end">{mm:g}</text>')
    for k, task in enumerate(tasks):
        parts.append(f'<text x="{x(k):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{task}</text>')
    parts.append(f'<text x="{LEFT}" y="{HEIGHT - 4}">rows; mean held-out error in mm</text>')
    shown = [(who, points) for who, points in lines.items() if points]
    for k, (who, points) in enumerate(shown):
        colour = COLOURS[names.index(who) % len(COLOURS)]
        path = " ".join(f"{x(at):.1f},{y(mm):.1f}" for at, mm in points)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{2.5 if who == names[0] else 1.5}"/>')
        parts += [f'<circle cx="{x(at):.1f}" cy="{y(mm):.1f}" r="3" fill="{colour}"/>' for at, mm in points]
        parts.append(f'<circle cx="{WIDTH - LEGEND + 20}" cy="{TOP + 10 + 18 * k}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{WIDTH - LEGEND + 30}" y="{TOP + 14 + 18 * k}">{html.escape(who)}</text>')
    return "".join(parts) + "</svg>"


def ticks(low: float, high: float) -> list[float]:
    """1, 2, 5, 10, … within a range of logarithms."""
    found = [a * 10.0**b for b in range(math.floor(low), math.ceil(high) + 1) for a in (1, 1.5, 2, 3, 5, 7)]
    return [mm for mm in found if low <= math.log10(mm) <= high]

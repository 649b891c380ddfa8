"""A benchmark as one self-contained HTML page: tables, curves and what the camera saw."""

import base64
import html
import re
from collections.abc import Callable, Sequence

from benchmarks.chart import Curve, Frame, bar, colour, plot
from benchmarks.episodes import Variant
from benchmarks.findings import NOTES, Findings
from benchmarks.pictures import moments
from benchmarks.published import TASKS
from benchmarks.table import Cells, Group, ablation_cells, category_cells

NUMBER = re.compile(r"^[–-]?[\d.]")


def page(findings: Findings) -> str:
    """The page; needs no network and no other file."""
    facts = "".join(f"<dt>{_text(name)}</dt><dd>{_text(value)}</dd>" for name, value in findings.facts.items())
    return _PAGE.format(
        facts=facts,
        ablation=_ablation(findings),
        curves="".join(_curves(findings, task) for task in TASKS),
        categories=_table(category_cells(findings.groups, findings.picks), block=slice(2, 4)),
        missing=_missing(findings),
        notes="".join(f"<p>{_code(note)}</p>" for note in NOTES),
        pictures=_pictures(findings),
    )


def _ablation(findings: Findings) -> str:
    low = _low([row.interval[0] if row.interval else row.ni for row in findings.rows])
    bars = ["dot: ours (95 %), diamond: paper", *(bar(row, low) for row in findings.rows)]
    return _table(ablation_cells(findings.rows), lambda number: f"<td>{bars[number]}</td>")


def _table(cells: Cells, extra: Callable[[int], str] = lambda number: "", block: slice = slice(0)) -> str:
    """A table; `extra` gives a cell that follows the first of each row. A line parts rows that differ in `block`."""
    rows = []
    for number, cell in enumerate(cells):
        kind = " class=first" if number and cell[block] != cells[number - 1][block] else ""
        rest = "".join(f'<td class="{"n" if NUMBER.match(text) else "t"}">{_code(text)}</td>' for text in cell[1:])
        rows.append(f"<tr{kind}><td>{_text(cell[0])}</td>{extra(number)}{rest}</tr>")
    return f"<div class=wide><table><thead>{rows[0]}</thead><tbody>{''.join(rows[1:])}</tbody></table></div>"


def _curves(findings: Findings, task: str) -> str:
    """All categories together, then each by itself."""
    every = [group for group in findings.groups if group.task == task]
    if not every:
        return ""
    low = _low([float(group.mean.min()) for group in findings.groups])
    whole = [group for group in every if group.category == "all"]
    plots = plot([_curve(group, findings) for group in whole], Frame(1180, 380, findings.picks, low, right=170))
    small = ""
    for category in dict.fromkeys(group.category for group in every if group.category != "all"):
        curves = [_curve(group, findings) for group in every if group.category == category]
        small += (
            f"<figure>{plot(curves, Frame(230, 170, findings.picks, low))}<figcaption>{category}</figcaption></figure>"
        )
    return f"<section class=task><h3>{task}</h3><div class=big>{plots}</div><div class=small>{small}</div></section>"


def _low(values: Sequence[float]) -> float:
    """Where an axis begins: at 0, or so far below as there is something, in quarters, down to -1."""
    return max(-1.0, min([0.0, *(value // 0.25 * 0.25 for value in values)]))


def _curve(group: Group, findings: Findings) -> Curve:
    return Curve(group.variant, _name(group.variant, findings), group.mean)


def _name(variant: Variant, findings: Findings) -> str:
    """The label, with the number of candidates where it tells two apart."""
    same = [row for row in findings.rows if row.variant.label == variant.label]
    return f"{variant.label} · {variant.candidates}" if len(same) > 1 else variant.label


def _pictures(findings: Findings) -> str:
    """For each task and category a strip of each method, of the same crumpled garment where it has been met."""
    sections: dict[str, str] = {}
    for group in findings.groups:
        shown = findings.picture(group) if group.category != "all" else None
        if shown is None:
            continue
        episode, path = shown
        picture = base64.b64encode(path.read_bytes()).decode()
        after = moments(len(episode.seconds))
        values = " · ".join(f"{pick}: {episode.ni[pick]:.2f}" for pick in after)
        title = f"{group.task}, {group.category}, state {episode.trial.state}"
        sections[title] = sections.get(title, "") + (
            f'<figure><img src="data:image/png;base64,{picture}" alt="{_text(group.variant.label)}"><figcaption><b'
            f' style="color:{colour(group.variant)}">{_text(_name(group.variant, findings))}</b> NI after {values}'
            f"{_text(f' · {episode.gave_up}' if episode.gave_up else '')}</figcaption></figure>"
        )
    if not sections:
        return ""
    strips = "".join(f"<h3>{title}</h3><div class=strips>{figures}</div>" for title, figures in sections.items())
    return f"<h2>What the camera saw</h2><p>Height above the table, dark low, yellow 6 cm and more.</p>{strips}"


def _missing(findings: Findings) -> str:
    if not findings.refusals:
        return ""
    items = "".join(f"<li><b>{_text(label)}</b>: {_code(reason)}</li>" for label, reason in findings.refusals.items())
    return f"<h2>Missing</h2><ul>{items}</ul>"


def _text(text: str) -> str:
    return html.escape(text)


def _code(text: str) -> str:
    """Escaped, with `words` as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Medor: closed loop</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 1400px; padding: 0 1rem;
       background: #f6f6f4; color: #222 }}
h1 {{ font-size: 1.5rem; margin: 0 0 .6rem }} h2 {{ font-size: 1.2rem; margin: 2rem 0 .6rem }}
h3 {{ font-size: 1rem; margin: 1rem 0 .4rem }}
dl {{ display: grid; grid-template-columns: auto 1fr; gap: .1rem 1rem; margin: 0 }}
dt {{ color: #666 }} dd {{ margin: 0; overflow-wrap: anywhere }}
.wide {{ overflow-x: auto; background: #fff; border: 1px solid #ddd; border-radius: 8px; padding: .4rem .6rem }}
table {{ border-collapse: collapse; font-size: 13px; width: 100%; font-variant-numeric: tabular-nums }}
td {{ padding: .18rem .4rem; border-bottom: 1px solid #eee; white-space: nowrap }}
thead td {{ color: #666; white-space: normal; vertical-align: bottom; border-bottom: 1px solid #bbb }}
tbody td:first-child {{ font-weight: 600 }}
.n {{ text-align: right }} .first td {{ border-top: 2px solid #ccc }}
.bar {{ width: 160px; height: 20px; display: block }}
.plot polyline {{ fill: none; stroke-width: 2.2; stroke-linejoin: round }}
.bar line:not([class]) {{ stroke-width: 2.5 }}
.plot text {{ font-size: 11px; fill: #666 }} .plot text.name {{ font-weight: 600; fill: revert-layer }}
.grid {{ stroke: #e4e4e0 }} .zero {{ stroke: #999 }} .paper {{ fill: none; stroke: #333; stroke-width: 1.2 }}
.task {{ background: #fff; border: 1px solid #ddd; border-radius: 8px; padding: .4rem 1rem 1rem; margin-bottom: 1rem }}
.big svg {{ width: 100% }}
.small {{ display: grid; grid-template-columns: repeat(5, 1fr); gap: .6rem }}
.strips {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(420px, 1fr)); gap: .8rem }}
figure {{ margin: 0 }} figcaption {{ font-size: 12px; color: #555; text-align: center }}
.strips figcaption {{ text-align: left }} img {{ width: 100%; border-radius: 4px }}
.notes {{ color: #444; font-size: 14px; max-width: 75rem }}
</style></head><body>
<h1>Medor: the closed loop on garments nothing was trained on</h1>
<dl>{facts}</dl>
<h2>By method</h2>{ablation}
{missing}
<h2>Normalized improvement over picks, mean</h2>{curves}
<h2>By category</h2>{categories}
{pictures}
<h2>How to read this</h2><div class=notes>{notes}</div>
</body></html>
"""

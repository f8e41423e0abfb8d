"""The certificate as one page that opens from disk and asks nothing of any network.

What reads and prints stands in the page as HTML. `page/viewer.js` and `page/page.css`, which `make client` builds from
`client/src/certificate/`, add the replay.
"""

import base64
import json
from html import escape
from pathlib import Path

from trunkline.identification.evaluation.error_tables import LABELS, TABLED, number
from trunkline.identification.stages import interval_words, stated_interval
from trunkline.recordings.trials.experiments import EXPERIMENTS

ASSETS = Path(__file__).parent / "page"
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
BESIDE = [LABELS[name] for name in TABLED]
VERDICT = {"good_for": "Good for", "not_for": "Not for", "next": "What to do next:"}
SPEEDS = (0.1, 0.25, 0.5, 1, 2)


def page(facts: dict, replays: dict, pictures: dict[str, bytes]) -> str:
    """The page of `facts`, as `certify` gives them.

    Args:
        replays: as `packed` gives them.
        pictures: PNGs: "uncertainty" and "poses".
    """
    parts = [_first(facts), _errors(facts), _replay(pictures), _parameters(facts), _uncertainty(facts, pictures)]
    parts += [_data(facts), _versions(facts), _signature()]
    title = escape(f"Calibration certificate: {facts['arm']['name']}, session {facts['session']['name']}")
    data = json.dumps(replays, separators=(",", ":")).replace("<", "\\u003c")
    script = (ASSETS / "viewer.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = (ASSETS / "page.css").read_text(encoding="utf-8")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{title}</title>\n'
        f'<link rel="icon" href="data:,">\n<style>\n{style}</style>\n</head>\n<body>\n'
        f"{''.join(parts)}"
        f'<script type="application/json" id="replays">{data}</script>\n'
        f'<script type="module">\n{script}</script>\n</body>\n</html>\n'
    )


def _first(facts: dict) -> str:
    arm, session = facts["arm"], facts["session"]
    lines = [f"<strong>{words}</strong> {escape(facts['verdict'][key])}" for key, words in VERDICT.items()]
    verdict = "<br>".join(lines)
    rows = {
        "Arm": f"{arm['name']}; {1e3 * arm['length_m']:.0f} mm, {arm['tendons']} tendons, "
        f"{arm['markers']} markers tracked",
        "Session": f"{session['name']}; {'; '.join(session['recorded'])}",
    }
    return (
        f'<header>\n<p class="kind">Calibration certificate</p>\n<h1>{escape(arm["name"])}, session '
        f"{escape(session['name'])}</h1>\n</header>\n<main>\n<p class=\"verdict\">{verdict}</p>\n"
        f"{_list(rows)}"
    )


def _errors(facts: dict) -> str:
    head = ["model of", "split", "trials", *BESIDE]
    shipped, others = ([_error_row(row) for row in facts["errors"] if row["shipped"] == is_it]
                       for is_it in (True, False))  # fmt: skip
    caption = "Position error over all markers / of the tip, mm (the former in % of length), mean over trials"
    note = (
        "<p class=\"quiet\">All rows are of the model that is shipped. Nothing was fitted to the trials of test; "
        "choices are made on those of validate. The noise floor is what noise and the fit of a pose leave by "
        "themselves.</p>\n"
    )
    before = ""
    if others:
        table = _table(caption, head, others)
        before = f"<details>\n<summary>Intermediate models, which are not shipped</summary>\n{table}</details>\n"
    return f"<h2>Errors</h2>\n{_table(caption, head, shipped)}{note}{before}"


def _error_row(row: dict) -> tuple[bool, list[str]]:
    kind = "all kinds" if row["kind"] is None else EXPERIMENTS[row["kind"]].plural
    cells = []
    for label in BESIDE:
        errors = row["errors"].get(label)
        if not errors:
            cells.append("–")
            continue
        tip = f" / {errors['e_tip_mm']:.3g}" if "e_tip_mm" in errors else ""
        cells.append(f"{errors['e_position_mm']:.3g}{tip} ({errors['e_position_pct']:.2g} %)")
    return row["kind"] is None, [row["model"], row["split"], f"{row['trials']} {kind}", *cells]


def _replay(pictures: dict[str, bytes]) -> str:
    speeds = "".join(f'<option value="{speed}">{speed} ×</option>' for speed in SPEEDS)
    speeds = speeds.replace('value="1"', 'value="1" selected')
    return f"""<h2>Replay</h2>
<p class="screen" id="replay-note">Measured (orange) and simulated arm; the simulated one is coloured by how far each
point is from where it was measured, white where that was not seen. Trials of the split that is kept for the score are
not shown.</p>
<div id="player">
<div class="bar"><label>Trial <select id="trial"></select></label>
<fieldset><legend>Arms</legend><label><input type="radio" name="layout" value="over" checked> overlaid</label>
<label><input type="radio" name="layout" value="beside"> side by side</label></fieldset></div>
<div id="stage"><canvas id="view" tabindex="0" role="img" aria-label="The arm in three dimensions. Arrow keys turn it,
plus and minus come nearer and go away, space plays."></canvas>
<span id="left" hidden>measured</span><span id="right" hidden>simulated</span></div>
<div class="bar"><button type="button" id="play">Play</button>
<input type="range" id="scrubber" min="0" max="0" step="1" value="0" aria-label="Time">
<label>Speed <select id="speed">{speeds}</select></label></div>
<div class="bar"><output id="now"></output><span class="quiet">Error: 0 <span id="scale"></span>
<span id="largest"></span></span><span class="quiet">Drag, or arrow keys, +, − and space on the picture</span></div>
</div>
<figure class="still"><img src="{_png(pictures["poses"])}" alt="Measured and simulated shapes of held-out trials at
their widest, each seen from the side to which it bends"><figcaption>Held-out trials at their widest, measured and
simulated.</figcaption></figure>
"""


def _parameters(facts: dict) -> str:
    parts = [
        "<h2>Parameters</h2>\n<p>Of a parameter that several stages identify, this is the last value, which the model "
        "has. Intervals given the model are right if the arm is as the model has it; those with the model's "
        "tolerances, if it is off by no more than is stated of its making and its laws. What else the model lacks is "
        "in neither.</p>\n"
    ]
    for stage, section in facts["parameters"].items():
        rows, every = [], section["parameters"] | section.get("per_session", {})
        for name, row in every.items():
            low, high = stated_interval(row)
            state = "on a bound" if row["at_bound"] else "undetermined" if row["undetermined"] else ""
            rows.append((False, [name, f"{row['value']:.4g}", f"{low:.4g} … {high:.4g}", row["unit"] or "–",
                                 f"{row['words']}{f'; {state}' if state else ''}"]))  # fmt: skip
        heads = ["parameter", "value", interval_words(every.values()), "unit", "in words"]
        table = _table(f"From {section['trials']} trials", heads, rows)
        parts.append(f"<h3>{stage}</h3>\n{table}")
        sentences = [f"What the trials tell least: {section['weakest_direction']}."]
        sentences += [f"Hardly told apart: {pair}." for pair in section["hardly_told_apart"]]
        sentences += [f"{line}." for line in section["open"]] or ["Nothing is on a bound or undetermined."]
        parts.append(f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in sentences)}</ul>\n")
        names = list(section["parameters"])
        matrix = [(False, [a, *(f"{section['correlation'][a][b]:+.2f}" for b in names)]) for a in names]
        table = _table("Correlations of the estimates", ["", *names], matrix)
        parts.append(f"<details>\n<summary>Correlations, {stage}</summary>\n{table}</details>\n")
    missing = facts["session"]["missing"]
    if missing:
        listed = "".join(f"<li>{escape(line)}</li>" for line in missing)
        parts.append(f"<h3>What the session's trials leave out</h3>\n<ul>{listed}</ul>\n")
    return "".join(parts)


def _uncertainty(facts: dict, pictures: dict[str, bytes]) -> str:
    uncertainty = facts["uncertainty"]
    radius, where = uncertainty["radius_mm"], uncertainty["conditions"]
    rows = []
    for line in uncertainty["lines"]:
        spread = number(line["standard_uncertainty"])
        slope = number(line["sensitivity_mm"])
        rows.append((False, [line["source"], line["distribution"], spread, line["unit"] or "–", slope,
                             f"{line['contribution_mm']:.2f}"]))  # fmt: skip
    rows.append((True, ["combined, with correlations", "", "", "", "", f"{uncertainty['combined_mm']:.2f}"]))
    head = ["source", "distribution", "standard uncertainty", "unit", "sensitivity, mm a unit", "contribution, mm"]
    caption = f"Root mean squares over {uncertainty['poses']} poses"
    still = ""
    if uncertainty["move_no_tip"]:
        still = f'<p class="quiet">No tip at rest moves with {escape(", ".join(uncertainty["move_no_tip"]))}.</p>\n'
    lacking = "Too few held-out trials at rest tell what the model lacks: it is not in here."
    if count := uncertainty["held_out_trials"]:
        constant, shares = uncertainty["lacking_constant_mm"], uncertainty["lacking_pct"]
        lacking = (
            f"What the model lacks, which no interval holds, is taken from the {count} held-out trials at rest: "
            f"{constant:.2g} mm everywhere, {shares['of_what_gravity_moves']:.2g} % of how far gravity moves the tip "
            f"and {shares['of_what_cables_move']:.2g} % of how far the cables do, root mean squares."
        )
        if learnt := uncertainty.get("residual_map"):
            lacking += (
                f" A residual map from {learnt['poses']} of them moves the twin's tip: in the median it rests "
                f"{learnt['left_out']:.2g} mm from there in poses that are left out, {learnt['twin']:.2g} mm without. "
                "All radii are of the tip that it moves."
            )
        if sure := uncertainty["sure_pulls_mm"]:
            lacking += f" Where motors pull by {sure:.0f} mm in all or less, the tip is within 1 % of the length."
    mounted = ""
    if session := uncertainty.get("mounted_as_in"):
        mounted = f" It is of the arm as it was mounted in the session {escape(session)}."
    pulled = (
        f"pulls of up to {1e3 * where['pull']:.0f} mm, together {1e3 * where['pulls']:.0f} mm, with the mount tilted "
        f"by up to {where['pulled_tilt_deg']:.1f}°; no pull, with the mount tilted by up to {where['tilt_deg']:.0f}°"
    )
    return (
        f"<h2>Uncertainty of the tip</h2>\n<p>At rest the tip is within <strong>{radius['median']:.3g} mm</strong> of "
        f"the twin's in 95 of 100 cases in the median pose, within {radius['p95']:.3g} mm in 95 of 100 poses. That is "
        f"the expanded uncertainty, from {uncertainty['draws']} draws of all sources through the model (JCGM 100, 101, "
        f"102). {lacking} It holds for what the session's trials at rest went up to: {pulled}.{mounted}</p>\n"
        f"<p>{escape(_measured(uncertainty))}</p>\n"
        f"{_table(caption, head, rows)}{still}"
        f'<figure><img src="{_png(pictures["uncertainty"])}" alt="Tips at rest over the workspace from two sides, '
        f'coloured by their expanded uncertainty, {radius["median"]:.3g} mm in the median, at most '
        f'{radius["max"]:.3g} mm">'
        "<figcaption>Expanded uncertainty of the tip over the workspace, the mount at the square.</figcaption>"
        "</figure>\n"
    )


def _measured(uncertainty: dict) -> str:
    """How often the arm's tip was within the radius, beside how often it is to be."""
    stated, measured = f"{100 * uncertainty['coverage']:.0f} %", uncertainty["measured"]
    if measured is None:
        return f"Whether {stated} of tips are within it, the arm itself was not asked: not measured."
    parts = {"poses that no trial has": measured} | (
        {"poses with a pull": measured["pulled"]} if "pulled" in measured else {}
    )
    shares = [
        f"in {100 * part['share']:.1f} % of {part['poses']} {words} (95 % interval {100 * part['low']:.0f} to "
        f"{100 * part['high']:.0f} %)"
        for words, part in parts.items()
    ]
    moving = f" In {measured['unrested']} more poses the arm did not come to rest." if measured["unrested"] else ""
    return f"Measured on the arm itself, beside the stated {stated}: its tip was within it {', '.join(shares)}.{moving}"


def _data(facts: dict) -> str:
    data = facts["data"]
    words = {
        "trials": "trials", "refused": "trials refused", "repairs": "repairs", "warnings": "warnings",
        "coverage": "share of frames that were seen", "dropped_frames": "frames dropped", "gaps": "gaps",
        "longest_gap_ms": "longest gap, ms", "gap_share": "share of samples in gaps",
        "filled_share": "share of samples filled", "rate_hz": "rate of the cameras, Hz",
        "position_noise_mm": "noise of positions, mm", "orientation_noise_deg": "noise of orientations, °",
        "clock_uncertainty_ms": "uncertainty of the clocks' offset, ms",
    }  # fmt: skip
    return f"<h2>Data quality</h2>\n{_list({words[key]: f'{data[key]:.4g}' for key in words if key in data})}"


def _versions(facts: dict) -> str:
    files = {f"SHA-256 of {path}": digest for path, digest in facts["files"].items()}
    made = {"SHA-256 of the code": facts["code"], "digest of the trials": facts["trials"]}
    digests = facts["versions"] | made | files
    rows = [(False, [name, digest]) for name, digest in digests.items()]
    table = _table("Versions and digests", ["what", "is"], rows, "code")
    return f"<h2>How it was made</h2>\n<p>To make it again: <code>{escape(facts['command'])}</code></p>\n{table}"


def _signature() -> str:
    fields = "".join(f"<div>{name}</div>" for name in ("Laboratory", "Name", "Date", "Signature"))
    return f'<h2>Signed for the laboratory</h2>\n<div class="signature">{fields}</div>\n</main>\n'


def _list(rows: dict[str, str]) -> str:
    return f"<dl>{''.join(f'<dt>{escape(name)}</dt><dd>{escape(text)}</dd>' for name, text in rows.items())}</dl>\n"


def _table(caption: str, head: list[str], rows: list[tuple[bool, list[str]]], last: str = "") -> str:
    """A table that scrolls by itself where it is too wide.

    Args:
        rows: whether one stands out, and its cells. last: the element that the last cell is put in.
    """
    heads = "".join(f'<th scope="col"{_wrapped(name)}>{escape(name)}</th>' if name else "<td></td>" for name in head)
    lines = []
    for whole, (first, *cells) in rows:
        marked = ' class="whole"' if whole else ""
        inside = [""] * (len(cells) - 1) + [last]
        parts = [_cell(*cell) for cell in zip(cells, head[1:], inside, strict=True)]
        lines.append(f'<tr{marked}><th scope="row">{escape(first)}</th>{"".join(parts)}</tr>')
    label = escape(caption, quote=True)
    return (
        f'<div class="table" role="group" tabindex="0" aria-label="{label}"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{heads}</tr></thead><tbody>{''.join(lines)}</tbody></table></div>\n"
    )


def _cell(text: str, head: str, inside: str) -> str:
    content = f"<{inside}>{escape(text)}</{inside}>" if inside else escape(text)
    return f"<td{_wrapped(head)}>{content}</td>"


def _wrapped(head: str) -> str:
    return ' class="wrap"' if head in ("in words", "distribution", "is") else ""


def _png(picture: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"

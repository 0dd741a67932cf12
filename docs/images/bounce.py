"""Draws bounce.svg, the arm without control beside the arm with its controller, from two runs of six seconds on the screen:

    painleve run open-loop-bounce --set run.duration_s=0.6 --csv out/bounce.csv --no-plot --no-record
    painleve run edge --csv out/edge.csv --no-plot --no-record
    python3 docs/images/bounce.py out/bounce.csv out/edge.csv > docs/images/bounce.svg
"""

import csv
import math
import sys

LINK_M, HEIGHT_M, PIXELS_PER_M = 0.21, 0.3775, 640
SHOULDER_Y, BELT_M_S = 68, 0.4
WIDTH = 370


def postures(path, every_tick, shoulder_x):
    """Returns shoulder, elbow and tip at every so many ticks of a run, and the run's duration in s."""
    with open(path, encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    found = []
    for row in rows[::every_tick]:
        x, y = shoulder_x, SHOULDER_Y
        points = [(x, y)]
        for angle in (float(row["plant.theta1_rad"]), float(row["plant.theta2_rad"])):
            x += LINK_M * PIXELS_PER_M * math.sin(angle)
            y += LINK_M * PIXELS_PER_M * math.cos(angle)
            points.append((x, y))
        found.append(points)
    return found, float(rows[-1]["time_s"])


def arm(path, every_tick, slower, title, note, left):
    """Returns one moving arm over its belt."""
    points, duration_s = postures(path, every_tick, left + 0.42 * WIDTH)
    duration = f'dur="{slower * duration_s:.2f}s" repeatCount="indefinite"'
    belt = SHOULDER_Y + HEIGHT_M * PIXELS_PER_M
    tips = [posture[2] for posture in points]

    def moving(attribute, values):
        return f'<animate attributeName="{attribute}" {duration} values="{";".join(values)}"/>'

    def text(posture):
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in posture)

    shoulder, _ = points[0][0]
    return f"""<text class="ink" x="{left + 8}" y="20" font-weight="bold">{title}</text>
<text class="ink" x="{left + 8}" y="44">{note}</text>
<line class="belt" x1="{left + 8}" y1="{belt}" x2="{left + WIDTH - 8}" y2="{belt}" stroke-width="4" stroke-dasharray="14 6"><animate
 attributeName="stroke-dashoffset" dur="{slower * 20 / (BELT_M_S * PIXELS_PER_M):.3f}s" repeatCount="indefinite" values="0;20"/></line>
<polyline class="link" fill="none" stroke-width="7" stroke-linecap="round" stroke-linejoin="round" points="{text(points[0])}">{
        moving("points", [text(posture) for posture in points])}</polyline>
<circle class="ink" cx="{shoulder:.1f}" cy="{SHOULDER_Y}" r="6"/>
<circle class="tip" cx="{tips[0][0]:.1f}" cy="{tips[0][1]:.1f}" r="5">{
        moving("cx", [f"{x:.1f}" for x, _ in tips])}{moving("cy", [f"{y:.1f}" for _, y in tips])}</circle>"""


def main():
    bounce, edge = sys.argv[1:3]
    without = arm(bounce, 4, 10, "Without control, 10 times slower", "the belt throws the tip off", 0)
    controlled = arm(edge, 50, 1, "With the controller, real time", "it slides to the edge and stays", WIDTH)
    print(f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} 352" width="{2 * WIDTH}" role="img" aria-labelledby="title">
<title id="title">Left: without control, the tip is thrown off the moving belt, lands and is thrown again. Right: the controller slides the tip to the edge of the paradox and holds it there</title>
<style>
svg {{ color-scheme: light dark; background: #fff; font: 18px sans-serif; }}
.link {{ stroke: #0072b2; }} .tip {{ fill: #d55e00; }} .ink {{ fill: #1a1a1a; }} .belt {{ stroke: #777; }}
@media (prefers-color-scheme: dark) {{ svg {{ background: #181818; }} .link {{ stroke: #4aa3df; }} .ink {{ fill: #eee; }} }}
</style>
{without}
{controlled}
<text class="ink" x="8" y="340">belt ← 0.4 m/s, friction coefficient 0.6</text>
</svg>""")


main()

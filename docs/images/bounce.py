"""Draws bounce.svg, the arm thrown off its belt in slow motion, from a run:

    painleve run open-loop-bounce --set run.duration_s=0.6 --csv out/bounce.csv --no-plot --no-record
    python3 docs/images/bounce.py out/bounce.csv > docs/images/bounce.svg
"""

import csv
import math
import sys

LINK_M, HEIGHT_M, PIXELS_PER_M, SLOWER = 0.21, 0.3775, 800, 10
SHOULDER = (140, 30)
EVERY_TICK = 4


def main():
    with open(sys.argv[1], encoding="utf-8") as table:
        rows = list(csv.DictReader(table))[::EVERY_TICK]
    postures = []
    for row in rows:
        x, y = SHOULDER
        points = [(x, y)]
        for angle in (float(row["plant.theta1_rad"]), float(row["plant.theta2_rad"])):
            x += LINK_M * PIXELS_PER_M * math.sin(angle)
            y += LINK_M * PIXELS_PER_M * math.cos(angle)
            points.append((x, y))
        postures.append(points)
    duration = f'dur="{SLOWER * float(rows[-1]["time_s"]):.2f}s" repeatCount="indefinite"'

    def moving(attribute, values):
        return f'<animate attributeName="{attribute}" {duration} values="{";".join(values)}"/>'

    def text(points):
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)

    belt = SHOULDER[1] + HEIGHT_M * PIXELS_PER_M
    tips = [points[2] for points in postures]
    print(f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 372" width="400" role="img" aria-labelledby="title">
<title id="title">Without control, the tip is thrown off the moving belt, lands and is thrown again; ten times slower</title>
<style>
svg {{ color-scheme: light dark; background: #fff; font: 13px sans-serif; }}
.link {{ stroke: #0072b2; }} .tip {{ fill: #d55e00; }} .ink {{ fill: #1a1a1a; }} .belt {{ stroke: #777; }}
@media (prefers-color-scheme: dark) {{ svg {{ background: #181818; }} .link {{ stroke: #4aa3df; }} .ink {{ fill: #eee; }} }}
</style>
<line class="belt" x1="10" y1="{belt}" x2="390" y2="{belt}" stroke-width="4" stroke-dasharray="14 6"><animate
 attributeName="stroke-dashoffset" dur="{SLOWER * 20 / (0.4 * PIXELS_PER_M):.3f}s" repeatCount="indefinite" values="0;20"/></line>
<polyline class="link" fill="none" stroke-width="7" stroke-linecap="round" stroke-linejoin="round" points="{text(postures[0])}">{
        moving("points", [text(points) for points in postures])}</polyline>
<circle class="ink" cx="{SHOULDER[0]}" cy="{SHOULDER[1]}" r="6"/>
<circle class="tip" cx="{tips[0][0]:.1f}" cy="{tips[0][1]:.1f}" r="5">{
        moving("cx", [f"{x:.1f}" for x, _ in tips])}{moving("cy", [f"{y:.1f}" for _, y in tips])}</circle>
<text class="ink" x="10" y="{belt + 25}">← belt 0.4 m/s, μ = 0.6, ten times slower</text>
</svg>""")


main()

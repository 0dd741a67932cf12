// Operates the page of a recorded run in headless Chromium: node page.mjs CHROMIUM RUN.html
// Prints what it checked; ends with 1 at the first thing that is wrong.

import { pathToFileURL } from "node:url";
import { Chromium, check, pause } from "./chromium.mjs";

const [program, file] = process.argv.slice(2);

const browser = await Chromium.start(program, { width: 1200, height: 900, dark: false });
try {
  await browser.open(pathToFileURL(file).href);
  await browser.until("typeof page !== 'undefined' && page.charts.plots.length > 0");
  const time = () => browser.evaluate("page.time");
  const end = await browser.evaluate("page.columns.end");
  check((await browser.evaluate("document.title")).endsWith("painleve"), "the page has a title");
  check(end > 0, "the run has a duration");

  const drawing = () => browser.evaluate("document.querySelector('#arm').toDataURL()");
  await browser.key("Home");
  await pause(100);
  const first = await drawing();
  check(await time() === 0, "Home goes to the start");
  await browser.click("#play");
  await browser.until("page.time > 0.2", "the run plays");
  await browser.click("#play");
  await pause(100);
  const stopped = await time();
  await pause(200);
  check(await time() === stopped, "a second click pauses");
  check(await drawing() !== first, "arm and belt have moved");
  check(await browser.evaluate("document.querySelector('#time').textContent") === `${stopped.toFixed(3)} s`, "the time is shown");

  await browser.click("#forward");
  check(await time() > stopped, "a step goes forward");
  await browser.key("ArrowLeft");
  await browser.key("ArrowLeft");
  check(await time() < stopped, "← goes back");
  await browser.key("End");
  check(Math.abs(await time() - end) < 1e-9, "End goes to the end");
  await browser.evaluate("(() => { const s = document.querySelector('#scrub'); s.value = 0.5 * page.columns.end; s.dispatchEvent(new Event('input')); })()");
  check(Math.abs(await time() - 0.5 * end) < 1e-3, "the slider moves through the run");

  const box = await browser.evaluate("(() => { scrollTo(0, 0); const b = page.charts.plots[0].plot.over.getBoundingClientRect(); return { x: b.x, y: b.y, width: b.width, height: b.height }; })()");
  const mouse = (type, part) => browser.send("Input.dispatchMouseEvent", { type, x: box.x + part * box.width, y: box.y + 0.5 * box.height, button: "left", buttons: 1, clickCount: 1 });
  await mouse("mouseMoved", 0.4);
  await mouse("mousePressed", 0.4);
  await mouse("mouseMoved", 0.5);
  await mouse("mouseMoved", 0.6);
  await mouse("mouseReleased", 0.6);
  await browser.until("page.charts.range !== null", "dragging zooms");
  const shown = await browser.evaluate("page.charts.plots.map(({ plot }) => [plot.scales.x.min, plot.scales.x.max])");
  check(shown.every(([from, to]) => from === shown[0][0] && to === shown[0][1] && to - from < 0.3 * end), "all charts show the stretch");
  const labels = await browser.evaluate("page.charts.plots.map(({ plot }) => plot.axes.map((axis) => axis._values?.filter((text) => text)))");
  check(labels.flat().every((texts) => !texts || new Set(texts).size === texts.length), "no label of an axis repeats");
  check(await browser.evaluate("page.time >= page.charts.range[0] && page.time <= page.charts.range[1]"), "the time is in the window");
  check(await browser.evaluate("page.charts.plots.every(({ playhead }) => !playhead.hidden)"), "the cursor is in every chart");
  const tip = await browser.evaluate("(() => { const { plot } = page.charts.plots[0]; const [a, b] = plot.series[0].idxs; const tip = plot.data[2].slice(a, b + 1).filter((v) => v !== null); return [plot.scales.y.max - plot.scales.y.min, Math.max(...tip) - Math.min(...tip)]; })()");
  check(tip[0] <= 3.5 * Math.max(tip[1], 2), "the values fill the window");
  check(!(await browser.evaluate("document.body.innerText")).includes("−0.0000"), "zero has no sign");
  const double = (type) => browser.send("Input.dispatchMouseEvent", { type, x: box.x + 0.5 * box.width, y: box.y + 0.5 * box.height, button: "left", clickCount: 2 });
  await double("mousePressed");
  await double("mouseReleased");
  check(await browser.evaluate("page.charts.range === null"), "a double click zooms out");
  await browser.key("+");
  check(await browser.evaluate("page.charts.range !== null"), "+ zooms");
  await browser.key("0");
  check(await browser.evaluate("page.charts.range === null"), "0 shows the whole run");

  await browser.click("#theme");
  check(await browser.evaluate("document.documentElement.dataset.theme") === "dark", "the theme changes");
  await browser.click("#events li:last-child button");
  check(Math.abs(await time() - await browser.evaluate("page.events.at(-1)[0]")) < 1e-3, "an event is a place to go to");
  const opened = () => browser.evaluate("document.querySelector('#events').open");
  const before = await opened();
  await browser.evaluate("document.querySelector('#events summary').focus()");
  await browser.key(" ");
  check(await opened() !== before && !await browser.evaluate("page.playing"), "the space bar opens and closes a part in focus");

  await browser.resize(400, 800);
  await pause(300);
  check(await browser.evaluate("document.documentElement.scrollWidth <= 400"), "nothing is wider than a narrow screen");
  await browser.quiet("at the end");
} finally {
  await browser.close();
}

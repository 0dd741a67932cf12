// Operates the page of a run that goes on, in headless Chromium: node live.mjs CHROMIUM URL
// Prints what it checked; ends with 1 at the first thing that is wrong.

import { Chromium, check, pause } from "./chromium.mjs";

const [program, url] = process.argv.slice(2);

const browser = await Chromium.start(program, { width: 1400, height: 900, dark: true });
try {
  await browser.open(url);
  await browser.until("typeof page !== 'undefined' && page.columns.end > 0.3", "the run starts with its viewer");
  const end = () => browser.evaluate("page.columns.end");
  const field = (key) => `input[name="${key}"]`;
  const message = "document.querySelector('#message')";
  const lifted = "page.events.some((event) => event[1] === 'lift-off')";

  const hidden = await browser.evaluate(`[...document.querySelectorAll("#readout, #readout td, #events, #events li")].filter((e) => {
    const b = e.getBoundingClientRect();
    return b.bottom > innerHeight || b.right > innerWidth || b.height === 0;
  }).map((e) => e.id || e.textContent)`);
  check(hidden.length === 0, `values and events are in sight ${hidden}`);
  check(await browser.evaluate("[...document.querySelectorAll('#stage')].every((e) => e.scrollHeight <= e.clientHeight)"), "without a box that scrolls");

  await browser.click("#play");
  await browser.until("!page.playing", "a click pauses");
  await pause(200);
  const paused = await end();
  await pause(300);
  check(await end() === paused, "time stands still");
  await browser.click("#forward");
  await browser.until(`page.columns.end > ${paused}`, "a step goes on");
  check(await end() < paused + 0.01, "a step is one tick");
  await browser.quiet("after a step");

  // The same wait once without and once with a click, so that only the push can be the cause.
  await browser.click("#play");
  await browser.until(`page.columns.end > ${paused} + 1.0`, "a second click resumes");
  check(!await browser.evaluate(lifted), "without a push the tip stays on the belt");
  const forces = () => browser.evaluate("page.columns.fn_n.slice(0, page.columns.length).reduce((least, f, i) => (page.columns.t[i] > 0.3 ? Math.min(least, f) : least), Infinity)");
  const before = await forces();
  check(before > 1, `the contact force is at least ${before} N`);
  await browser.click("#pushes button:nth-of-type(3)");
  await browser.until(lifted, "a push lifts the tip off");
  await browser.quiet("after a push");
  for (const number of [1, 2]) await browser.click(`#pushes button:nth-of-type(${number})`);
  await pause(300);
  await browser.quiet("after pushes along the belt");

  for (const factor of ["0.01", "0.03", "0.1", "0.3", "3"]) {
    await browser.set("#speed", factor);
    await browser.until(`Math.abs(Number.parseFloat(document.querySelector("#status").textContent) / ${factor} - 1) < 0.5`, `the run passes at ${factor} times real time`);
    await browser.quiet(`at ${factor} times real time`);
  }

  await browser.set(field("belt.friction"), "1.2");
  await browser.until(`${message}.textContent === "belt.friction: set"`, "a value can be set");
  await browser.until("document.querySelector('#subtitle').textContent.includes('μ = 1.2 ')", "the header shows the present friction");
  await browser.set(field("any"), "run.seed = 77");
  await browser.until(`${message}.textContent === "run.seed: set; takes effect at the next reset"`, "a key can be set by name");
  check(!await browser.evaluate("document.querySelector('#subtitle').textContent.includes('seed 77')"), "the header waits for the reset");
  await browser.set(field("any"), "controller.law = { pid = {} }");
  await browser.until("document.querySelector('#subtitle').textContent.includes('Law pid')", "the header shows the present law");
  const offers = (key) => `document.querySelector(${JSON.stringify(field(key))})`;
  await browser.until(`!${offers("controller.law.hybrid.normal_force_n")} && ${offers("belt.friction")}.value === "1.2"`, "settings of the law before are not offered");
  const saved = (id) => browser.evaluate(`decodeURIComponent(document.querySelector("#${id}").href)`);
  const settings = await saved("save");
  for (const part of ["friction = 1.2", "seed = 77", "[controller.law.pid]"]) check(settings.includes(part), `${part} is saved`);
  const changes = await saved("save-changes");
  for (const part of ["painleve run ", "--set belt.friction=1.2", "--set run.seed=77", "--set 'controller.law={ pid = {} }'"]) check(changes.includes(part), `${part} is among the changes`);
  await browser.quiet("after settings");

  await browser.set(field("belt.friction"), "7000");
  await browser.until(`${message}.className === "error" && ${message}.textContent.includes("belt.friction")`, "what is out of range is refused by name");
  await browser.set("#speed", "1");
  await browser.until(`${message}.textContent === ""`, "the next accepted order removes the error");
  await browser.set(field("belt.friction"), "7000");
  await browser.until(`${message}.className === "error"`, "it is refused again");

  await browser.set("#speed", "0");
  await browser.until("/\\d{4,} ticks/.test(document.querySelector('#status').textContent)", "the run goes faster than real time");
  await browser.until("page.columns.start > 0 && page.charts.plots.every(({ plot }) => plot.scales.x.min > 0)", "the charts follow the run");
  await browser.set(field("belt.friction"), "7000");
  await browser.until(`${message}.className === "error"`, "it is refused at any speed");
  await browser.set("#speed", "1");
  await pause(300);
  await browser.click("#reset");
  await browser.until("page.columns.end < 3 && page.events.length < 20", "the run starts again");
  await browser.until("document.querySelector('#subtitle').textContent.includes('seed 77')", "with what waited for it");
  await browser.quiet("after a reset");
} finally {
  await browser.close();
}

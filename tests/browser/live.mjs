// Operates the page of a run that goes on, in headless Chromium: node live.mjs CHROMIUM URL
// Prints what it checked; ends with 1 at the first thing that is wrong.

import { Chromium, check, pause } from "./chromium.mjs";

const [program, url] = process.argv.slice(2);

const browser = await Chromium.start(program, { width: 1200, height: 900, dark: true });
try {
  await browser.open(url);
  await browser.until("typeof page !== 'undefined' && page.columns.end > 0.3", "the run starts with its viewer");
  const end = () => browser.evaluate("page.columns.end");
  const set = (name, value) => browser.evaluate(`(() => { const i = document.querySelector('input[name="${name}"]'); i.value = ${JSON.stringify(value)}; i.dispatchEvent(new Event('change')); })()`);

  await browser.click("#play");
  await browser.until("!page.playing", "a click pauses");
  await pause(200);
  const paused = await end();
  await pause(300);
  check(await end() === paused, "time stands still");
  await browser.click("#forward");
  await browser.until(`page.columns.end > ${paused}`, "a step goes on");
  check(await end() < paused + 0.01, "a step is one tick");
  await browser.click("#play");
  await browser.until(`page.columns.end > ${paused} + 0.2`, "a second click resumes");

  check(await browser.evaluate("page.events.every((event) => event[1] !== 'lift-off')"), "the tip has stayed on the belt");
  await set("any", "controller.law = { pid = { proportional_nm_rad = [0.0, 0.0] } }");
  await browser.until("document.querySelector('#parameters .error').textContent.includes('set')", "a key can be set by name");
  await set("belt.friction", "7000");
  await browser.until("document.querySelector('#parameters .error').textContent.includes('belt.friction')", "what is out of range is refused by name");
  await browser.click("#parameters button:nth-of-type(3)");
  await browser.until("page.events.some((event) => event[1] === 'lift-off')", "a push lifts the tip off");
  await browser.evaluate("(() => { const s = document.querySelector('#speed'); s.value = '0'; s.dispatchEvent(new Event('change')); })()");
  await browser.until("/\\d{4,} ticks/.test(document.querySelector('#status').textContent)", "the run goes faster than real time");
  await browser.until("page.columns.start > 0 && page.charts.plots.every(({ plot }) => plot.scales.x.min > 0)", "the charts follow the run");
  await browser.evaluate("(() => { const s = document.querySelector('#speed'); s.value = '1'; s.dispatchEvent(new Event('change')); })()");
  await pause(300);
  await browser.click("#reset");
  await browser.until("page.columns.end < 3 && page.events.length < 20", "the run starts again");
  check(browser.problems.length === 0, `the console is empty ${browser.problems.join("; ")}`);
} finally {
  await browser.close();
}

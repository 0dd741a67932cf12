// The second of the first ten things on the page of a run that goes on, in headless Chromium:
// pause, raise the belt's friction, continue, see the tip lift off. node friction.mjs CHROMIUM URL

import { Chromium, check, pause } from "./chromium.mjs";

const [program, url] = process.argv.slice(2);

const browser = await Chromium.start(program, { width: 1200, height: 900, dark: false });
try {
  await browser.open(url);
  await browser.until("typeof page !== 'undefined' && page.columns.end > 1.5", "the run starts with its viewer");
  const friction = "document.querySelector('input[name=\"belt.friction\"]')";
  check(await browser.evaluate(`${friction}.value`) === "0.3", "the field shows the scenario's friction");
  check(await browser.evaluate("page.events.every((event) => event[1] !== 'lift-off')"), "the tip stays on the belt");
  await browser.click("#play");
  await browser.until("!page.playing", "a click pauses");
  await browser.set('input[name="belt.friction"]', "0.6");
  await browser.until("document.querySelector('#message').textContent === 'belt.friction: set'", "the friction is set");
  check(await browser.evaluate("page.events.every((event) => event[1] !== 'lift-off')"), "nothing happens while the run is paused");
  await browser.click("#play");
  await browser.until("page.events.some((event) => event[1] === 'lift-off')", "the tip lifts off");
  await pause(500);
  check(await browser.evaluate(`${friction}.value`) === "0.6", "the field keeps the new friction");
  await browser.quiet("at the end");
} finally {
  await browser.close();
}

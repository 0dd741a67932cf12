// The page of a run that goes on while it draws no pictures, without its connection, and as one viewer too many, in headless
// Chromium: node adversity.mjs CHROMIUM URL

import { Chromium, check, pause } from "./chromium.mjs";

const [program, url] = process.argv.slice(2);

const browser = await Chromium.start(program, { width: 1200, height: 900, dark: false });
try {
  await browser.send("Page.addScriptToEvaluateOnNewDocument", { source: `{
    const Original = WebSocket, draw = requestAnimationFrame;
    window.sockets = [];
    window.WebSocket = class extends Original { constructor(...address) { super(...address); sockets.push(this); } };
    window.others = [];
    window.join = () => others.push(new Original(\`ws://\${location.host}/live\${location.search}\`));
    window.drawing = (wanted) => { window.requestAnimationFrame = wanted ? draw : () => 0; if (wanted) draw((now) => page.frame(now)); };
  }` });
  await browser.open(url);
  const text = (id) => `document.querySelector("#${id}").textContent`;
  const runs = `page.columns.length > 0 && ${text("status")}.includes("real time")`;
  await browser.until(`${text("verdict")}.includes("first at")`, "the first lift-off is reported");
  const verdict = await browser.evaluate(text("verdict"));

  await browser.evaluate("drawing(false)");
  await browser.set("#speed", "0");
  await browser.until("page.run.totals.impact?.[0] > 600", "more events are counted than listed");
  check(!await browser.evaluate("page.events.some((event) => event[1] === 'lift-off')"), "the lift-off has left the list");
  check(await browser.evaluate(text("verdict")) === verdict, `the verdict remains: ${verdict}`);
  await browser.until("page.columns.start > 0", "the oldest rows go");
  const [rows, events] = await browser.evaluate("[page.columns.length, page.events.length]");
  check(rows <= 15000 && events === 500, `without pictures ${rows} rows and ${events} events are kept`);
  await browser.evaluate("drawing(true)");
  await browser.until(`${text("events summary")}.includes("the last 500 listed")`, "the list says what it leaves out");
  await browser.until("document.querySelectorAll('#events li').length === 500", "the last events are listed");
  check(await browser.evaluate(`Math.abs(Number.parseFloat(document.querySelector("#events li").textContent) - page.events[0][0]) < 1e-3`), "from the oldest one on");

  await browser.set("#speed", "1");
  await pause(300);
  await browser.click("#reset");
  await browser.until(`page.columns.end < 2 && ${runs}`, "the run starts again");
  check(await browser.evaluate("page.columns.start") === 0, "with its first tick");
  check(await browser.evaluate("(page.run.totals.impact?.[0] ?? 0) < 100"), "and counts again");

  await browser.evaluate("sockets[0].close()");
  await browser.until(`sockets.length === 2 && ${runs}`, "a lost connection is made again");
  for (let number = 0; number < 7; number++) await browser.evaluate("join()");
  await browser.until("others.every((socket) => socket.readyState === 1)", "seven others watch");
  await browser.evaluate("sockets[1].close()");
  await pause(300);
  await browser.evaluate("join()");
  await browser.until(`${text("status")}.includes("8 viewers of this kind watch the run already")`, "one too many is told so");
  check(await browser.evaluate("page.columns.length > 0"), "and keeps what it has");
  await browser.evaluate("others[0].close()");
  await browser.until(runs, "it watches again once another has left");
  await browser.quiet("at the end");
} finally {
  await browser.close();
}

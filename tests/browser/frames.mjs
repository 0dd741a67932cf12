// Measures how smoothly the page of a recorded run plays in headless Chromium: node frames.mjs CHROMIUM RUN.html
// Prints frames per second and the time that the page's thread needs for each, which other programs disturb less.

import { pathToFileURL } from "node:url";
import { Chromium } from "./chromium.mjs";

const [program, file] = process.argv.slice(2);
const SECONDS = 10;

const browser = await Chromium.start(program, { width: 1200, height: 900, dark: false });
try {
  await browser.send("Performance.enable");
  await browser.open(pathToFileURL(file).href);
  await browser.until("typeof page !== 'undefined' && page.charts.plots.length > 0");
  const busy = async () => (await browser.send("Performance.getMetrics")).metrics.find(({ name }) => name === "TaskDuration").value;
  await browser.evaluate("page.seek(0), page.play(true)");
  const before = await busy();
  const [frames, seconds] = await browser.evaluate(`new Promise((done) => { let n = 0; const t = performance.now(); const f = (now) => { n++; now - t > ${1000 * SECONDS} ? done([n, (now - t) / 1000]) : requestAnimationFrame(f); }; requestAnimationFrame(f); })`);
  const per = (await busy() - before) / frames;
  console.log(`${(frames / seconds).toFixed(1)} frames/s, ${(1000 * per).toFixed(1)} ms for each`);
} finally {
  await browser.close();
}
